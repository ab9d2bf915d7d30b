# SPDX-License-Identifier: Apache-2.0
# Copyright 2026 color_stereo_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The pieces of a self-contained HTML page: its style, sections, figures and tables."""

from html import escape

CSS = """
:root { --ink: #1c2330; --soft: #5b6472; --line: #e3e6eb; --paper: #ffffff; --tint: #f6f7f9;
        --good: #0b7a5b; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--tint); color: var(--ink); line-height: 1.55;
       font: 16px/1.55 "Inter", "Segoe UI", "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 32px 28px 80px; }
header { background: linear-gradient(100deg, #47246b, #1f4e8c 35%, #0b7a5b 65%, #d98324);
         color: #fff; padding: 46px 0 40px; }
header div { max-width: 1180px; margin: 0 auto; padding: 0 28px; }
h1 { margin: 0 0 6px; font-size: 33px; letter-spacing: -0.4px; }
header p { margin: 0; opacity: 0.92; max-width: 76ch; }
nav { margin-top: 16px; font-size: 14px; } nav a { color: #fff; margin-right: 16px; }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 12px;
          padding: 22px 26px 26px; margin: 22px 0; }
h2 { margin: 0 0 6px; font-size: 21px; } h3 { margin: 22px 0 4px; font-size: 16px; }
p { max-width: 82ch; } .soft, figcaption { color: var(--soft); font-size: 14px; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(165px, 1fr)); gap: 12px;
         margin: 14px 0 4px; }
.tile { border: 1px solid var(--line); border-radius: 10px; padding: 12px 14px; }
.tile b { display: block; font-size: 25px; letter-spacing: -0.5px; }
.tile span { color: var(--soft); font-size: 13px; display: block; line-height: 1.35; }
table { border-collapse: collapse; width: 100%; font-size: 14px; margin: 12px 0;
        font-variant-numeric: tabular-nums; }
th { text-align: right; color: var(--soft); font-weight: 600; border-bottom: 2px solid var(--line);
     padding: 6px 9px; vertical-align: bottom; }
td { text-align: right; border-bottom: 1px solid var(--line); padding: 6px 9px; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; }
td:nth-child(2) { white-space: nowrap; } tr.own td { background: #f1f8f5; }
td small { color: var(--soft); } td.best { font-weight: 700; color: var(--good); }
.wide { overflow-x: auto; } .dense table { font-size: 12.2px; }
.dense th, .dense td { padding: 5px 6px; }
.ridge img { max-width: 980px; } svg { width: 100%; max-width: 980px;
        height: auto; } figure { margin: 14px 0; }
.gallery { display: grid; gap: 10px;
           grid-template-columns: repeat(auto-fill, minmax(165px, 1fr)); }
.gallery figure { margin: 0; } .gallery img, figure img { width: 100%; border-radius: 6px;
        display: block; }
.gallery img { image-rendering: auto; background: #222; }
details { border-top: 1px solid var(--line); padding: 9px 0; }
summary { cursor: pointer; font-weight: 600; }
.key { display: inline-block; width: 12px; height: 12px; border-radius: 3px; margin: 0 5px 0 12px;
       vertical-align: -1px; border: 1px solid #c9ced6; }
.bar { display: inline-block; width: 130px; height: 11px; border-radius: 3px; margin: 0 5px;
       vertical-align: -1px; }
code { background: #eef0f4; border-radius: 4px; padding: 1px 5px; font-size: 90%; }
"""


def section(anchor, title, body):
    """Return one section of the page."""
    return f'<section id="{anchor}"><h2>{title}</h2>{body}</section>'


def note(text):
    """Return a paragraph of explanation."""
    return f'<p class="soft">{text}</p>'


def figure(content, text):
    """Return a figure; the text is for those who cannot see it."""
    return f'<figure>{described(content, text)}</figure>'


def panel(title, image, text=''):
    """Return one picture of a gallery; the text says more than the title if that is short."""
    return (f'<figure>{described(image, text or title)}'
            f'<figcaption>{escape(title)}</figcaption></figure>')


def described(content, text):
    """Return an embedded image or inline SVG with a description for screen readers."""
    label = escape(text, quote=True)
    if content.startswith('<svg'):
        return content.replace('<svg', f'<svg role="img" aria-label="{label}"', 1)
    return content.replace('alt=""', f'alt="{label}"', 1)


def table(heads, rows):
    """Return a table of (cells, highlighted) rows; one of many columns is set smaller."""
    dense = ' dense' if len(heads) > 12 else ''
    head = ''.join(f'<th>{text}</th>' for text in heads)
    body = ''.join(f'<tr{" class=own" if own else ""}>'
                   + ''.join(f'<td>{cell}</td>' for cell in cells) + '</tr>'
                   for cells, own in rows)
    return f'<div class="wide{dense}"><table><tr>{head}</tr>{body}</table></div>'
