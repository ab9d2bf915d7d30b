# SPDX-License-Identifier: Apache-2.0
"""
Kernels of the surface method: bare arrays in and out, meaning lives in `surface`.

Words used below. The *half grid* has one node per 2 x 2 rectified pixels, at their center; the
right image keeps all its columns on half the rows, so that a disparity is sampled finely. u, v are
the two chromaticity coordinates, s the brightness they were divided by. A plane d + a i + b j
gives the disparity (full pixels) i nodes to the right and j nodes below a node. NaN = unknown;
therefore never fastmath=True.

All half-grid arrays of the left image (and the rows of the right one) carry a frame of PAD
unknown nodes and are rounded up to whole tiles of TILE_ROWS x TILE_COLUMNS nodes, so that no
kernel needs to ask where the image ends. A tile is *smooth* where one surface fills it and its
surroundings; there windows need no gate, and sums over them are separable.

"""

import math

import numpy as np
from numba import njit

from ._band_kernels import band, banded, BANDS
from ._part_kernels import part
from ._stack_kernels import LENGTH, stack_array, stack_row
from .types import Status

FAST = {'nsz', 'arcp', 'contract', 'afn', 'reassoc'}  # the NaN-safe subset
F4 = np.float32
I4 = np.int32
U4 = np.uint32
PAD = 8  # unknown nodes around a half grid: window radius + halo, or propagation step + halo
TILE_ROWS = 8
TILE_COLUMNS = 32
RADIUS = 4  # of the least-squares window, nodes
WIDE_RADIUS = 7  # likewise where one surface fills a tile and as much around it
JITTER = F4(0.04)  # px^2: what demosaicing and blur move the colors of a pixel
FLAT = F4(4.0)  # a chromaticity variance, before its scale is measured, without information
LEAST_WEIGHT = F4(1e-2)  # px^-2 of a window: less is rounding
NAN = F4(np.nan)
CORRELATED = F4(1.2)  # variance of neighbors that share their noise, fitted on simulated scenes
BENT = F4(0.8)        # standard deviation per distance of the neighbors, fitted likewise
ISLAND = F4(-50)    # log-odds of a node in too small a segment
WHOLE = 16          # what a bright node counts in a segment; a black one counts 1
HOPELESS = F4(-200)  # log-odds where no range is possible
LEAST_ODDS, MOST_ODDS = F4(-6), F4(14)  # of a node, where they are interpolated; 14: 1 - 1e-6
OWN_SHARE = F4(0.25)  # of a node in the log-odds of its pixels, beside the interpolated ones
UNKNOWN = F4(-100)  # log-odds of a node without disparity
PITCH_DARK = F4(1)  # DN of summed channels: darker nodes get no range from their neighbors
CEILING = F4(30)  # of a misfit that counts as evidence
MURK = F4(3)      # DN of summed channels: below, brightness is mostly noise and scattered light
VALID = np.uint8(Status.VALID)
OUTSIDE_IMAGE = np.uint8(Status.OUTSIDE_IMAGE)
DARK = np.uint8(Status.DARK)
SATURATED = np.uint8(Status.SATURATED)
NO_MATCH = np.uint8(Status.NO_MATCH)
AMBIGUOUS = np.uint8(Status.AMBIGUOUS)
INCONSISTENT = np.uint8(Status.INCONSISTENT)
OUT_OF_RANGE = np.uint8(Status.OUT_OF_RANGE)
IMPLAUSIBLE = np.uint8(Status.IMPLAUSIBLE)


@banded()
def box_sums(k, pixels, out):
    """
    Sum 2 x 2 pixels into uint32 (H, W): red + green 2^10 + blue 2^20.

    pixels, uint32 (H, W), hold red, green, blue and anything in ascending bytes. out[y, x] covers
    the pixels x, x + 1 of the rows y, y + 1; last row and column are repeated. Four bytes add up
    to ten bits, so that colors can be added, and gathered, as one number.

    """
    height, width = out.shape
    first, last = band(k, height)
    for y in range(first, last):
        above = pixels[y]
        below = pixels[min(y + 1, height - 1)]
        row = out[y]
        for x in range(width):
            a, b = above[x], below[x]
            red = U4((a & U4(0xff)) + (b & U4(0xff)))
            green = U4((a & U4(0xff00)) + (b & U4(0xff00)))
            blue = U4((a & U4(0xff0000)) + (b & U4(0xff0000)))
            row[x] = red | U4(green << U4(2)) | U4(blue << U4(4))
        for x in range(width - 1):
            row[x] = U4(row[x] + row[x + 1])
        row[width - 1] = U4(row[width - 1] + row[width - 1])


@njit(cache=True, nogil=True, error_model='numpy')
def channel_levels(pixels, step, known_dark, darkest, dark, mean):
    """
    Dark level and mean above it of each channel (float32 (3,), DN) in every step-th pixel.

    pixels is uint8 (H, W, 3 or more). The dark level is known_dark, or if that is negative the
    level that half a percent of the pixels do not exceed, at most `darkest`: above that is light.

    """
    counts = np.zeros((3, 256), np.int64)
    total = 0
    for y in range(step // 2, pixels.shape[0], step):
        for x in range(step // 2, pixels.shape[1], step):
            for channel in range(3):
                counts[channel, pixels[y, x, channel]] += 1
            total += 1
    for channel in range(3):
        level = known_dark
        if known_dark < F4(0):
            at, seen = 0, counts[channel, 0]
            while at < darkest and seen <= total // 200:
                at += 1
                seen += counts[channel, at]
            level = F4(at)
        above = F4(0)
        for at in range(256):
            above += F4(counts[channel, at]) * max(F4(at) - level, F4(0))
        dark[channel] = level
        mean[channel] = above / F4(total)


@banded(fastmath=FAST)
def sample_colors(k, box, index, frac_x, frac_y, stride, dark, gain, soft, saturation, noise,
                  widening, ring, u, v, s, peak, variance):
    """
    Rectify: sample box sums bilinearly at mapped positions and turn them into chromaticity.

    box is uint32 flat with `stride` entries a row, see `box_sums`; index int32 (h, w) names the
    upper left neighbor, -1 = outside. Writes u = (2 r - g - b) / (s + soft),
    v = sqrt(3) (g - b) / (s + soft), s = r + g + b (DN, dark level subtracted, gains applied),
    peak, the brightest raw channel (DN), and the variance of each chromaticity,
    (floor + shot s + relative s^2) / s^2 with noise = (floor, shot, relative), FLAT where a color
    says nothing: outside, from the peak `saturation` on, or black. Outside u = v = s = 0,
    peak = -1.

    widening, float32 (2, h, w) along rows and columns, evens out what nodes see through, see
    `widen_row`; (2, 0, 0): nothing is to be done. ring is float32 (BANDS, 3, 3, w): the last three
    rows of u, those of v, and room for what nobody needs of the bands beside.

    """
    rows = index.shape[0]
    first, last = band(k, rows)
    if first == last:
        return
    plain = widening.shape[1] == 0
    low, high = (first, last) if plain else (max(first - 1, 0), min(last + 1, rows))
    us, vs, spare = ring[k, 0], ring[k, 1], ring[k, 2]
    for y in range(low, high + 1):
        if y < high:
            own = (y >= first) & (y < last)
            sample_row(box, index[y], frac_x[y], frac_y[y], stride, dark, gain, soft, saturation,
                       noise, u[y] if plain else us[y % 3], v[y] if plain else vs[y % 3],
                       s[y] if own else spare[0], peak[y] if own else spare[1],
                       variance[y] if own else spare[2])
        here = y - 1
        if (not plain) & (here >= first) & (here < last):
            above, below = max(here - 1, 0) % 3, min(here + 1, rows - 1) % 3
            widen_row(us[above], us[here % 3], us[below], vs[above], vs[here % 3], vs[below],
                      widening[0, here], widening[1, here], u[here], v[here])


@part(fastmath=FAST)
def sample_row(box, index, frac_x, frac_y, stride, dark, gain, soft, saturation, noise, u, v, s,
               peak, variance):
    """Sample one row of nodes, see `sample_colors`."""
    columns = index.size
    dark_r, dark_g, dark_b = dark[0], dark[1], dark[2]
    gain_r, gain_g, gain_b = gain[0], gain[1], gain[2]
    floor, shot, relative = noise
    root3, one, zero = F4(math.sqrt(3.0)), F4(1), F4(0)
    quarter, ten_bits = F4(0.25), U4(1023)
    us, vs, totals = stack_row(), stack_row(), stack_row()
    peaks, spreads = stack_row(), stack_row()
    for start in range(0, columns, LENGTH):
        stop = min(start + LENGTH, columns)
        places = index[start:stop]
        row_x, row_y = frac_x[start:stop], frac_y[start:stop]
        for x in range(stop - start):
            outside = places[x] < 0
            p = U4(0 if outside else places[x])
            q = U4(p + stride)
            c00, c01, c10, c11 = box[p], box[U4(p + U4(1))], box[q], box[U4(q + U4(1))]
            fx, fy = row_x[x], row_y[x] * quarter
            gx, gy = one - fx, quarter - fy
            w00, w01, w10, w11 = gx * gy, fx * gy, gx * fy, fx * fy
            r = (w00 * F4(I4(c00 & ten_bits)) + w01 * F4(I4(c01 & ten_bits))
                 + w10 * F4(I4(c10 & ten_bits)) + w11 * F4(I4(c11 & ten_bits)))
            g = (w00 * F4(I4((c00 >> U4(10)) & ten_bits))
                 + w01 * F4(I4((c01 >> U4(10)) & ten_bits))
                 + w10 * F4(I4((c10 >> U4(10)) & ten_bits))
                 + w11 * F4(I4((c11 >> U4(10)) & ten_bits)))
            b = (w00 * F4(I4(c00 >> U4(20))) + w01 * F4(I4(c01 >> U4(20)))
                 + w10 * F4(I4(c10 >> U4(20))) + w11 * F4(I4(c11 >> U4(20))))
            highest = max(r, max(g, b))
            r = max(r - dark_r, zero) * gain_r
            g = max(g - dark_g, zero) * gain_g
            b = max(b - dark_b, zero) * gain_b
            total = r + g + b
            scale = one / (total + soft)
            inverse = one / max(total, F4(1e-3))
            spread = relative + inverse * (shot + floor * inverse)
            silent = outside | (highest >= saturation) | (spread > FLAT)
            us[x] = zero if outside else (r + r - g - b) * scale
            vs[x] = zero if outside else (g - b) * (scale * root3)
            totals[x] = zero if outside else total
            peaks[x] = -one if outside else highest
            spreads[x] = FLAT if silent else spread
        for x in range(stop - start):
            u[start + x] = us[x]
            v[start + x] = vs[x]
            s[start + x] = totals[x]
            peak[start + x] = peaks[x]
            variance[start + x] = spreads[x]


@part(fastmath=FAST)
def widen_row(u0, u1, u2, v0, v1, v2, gain_x, gain_y, out_u, out_v):
    """
    Add second differences along and across a row to its chromaticities, each times its gain.

    u0, u1, u2 are the row above, the row and the row below; the outermost nodes are copied. A
    gain g widens the kernel through which a node sees by 2 g in variance, nodes^2; a negative one
    narrows it.

    """
    last = u1.size - 1
    one, two = F4(1), F4(2)
    for place in (0, last):
        out_u[place], out_v[place] = u1[place], v1[place]
    before_u, here_u, after_u = u1[:last - 1], u1[1:last], u1[2:]
    before_v, here_v, after_v = v1[:last - 1], v1[1:last], v1[2:]
    above_u, below_u, above_v, below_v = u0[1:last], u2[1:last], v0[1:last], v2[1:last]
    along, across = gain_x[1:last], gain_y[1:last]
    inner_u, inner_v = out_u[1:last], out_v[1:last]
    for x in range(inner_u.size):
        own = one - two * (along[x] + across[x])
        inner_u[x] = (own * here_u[x] + along[x] * (before_u[x] + after_u[x])
                      + across[x] * (above_u[x] + below_u[x]))
    for x in range(inner_v.size):
        own = one - two * (along[x] + across[x])
        inner_v[x] = (own * here_v[x] + along[x] * (before_v[x] + after_v[x])
                      + across[x] * (above_v[x] + below_v[x]))


@banded(fastmath=FAST)
def linearize(k, left_u, left_v, left_var, right_u, right_v, right_var, matrix, d, tiles, robust,
              scale, reference, weight, moment, misfit):
    """
    Compare every node of some tiles with the place its disparity points to, and linearize there.

    With e = L - M R(x - d) and g = M R'(x - d), an error of the disparity shows as e = g (d -
    d_true). Writes weight = w g.g, moment = weight (d - reference) - w g.e and misfit = w e.e,
    where w = 1 / (scale (var_L + var_R)) and, in weight and moment, is multiplied by Cauchy's
    1 / (1 + misfit / robust). Interpolated by cubics through four columns: what is linear
    pulls towards whole pixels, and Catmull-Rom does so by .006 px. matrix (2, 3) maps right
    chromaticities to left ones. Unknown d, no information, or a place outside the right image:
    weight = moment = 0, misfit NaN.

    """
    width = right_u.shape[1]
    m00, m01, m02 = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    m10, m11, m12 = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    one, two, three, half, sixth = F4(1), F4(2), F4(3), F4(0.5), F4(1 / 6)
    first, last = band(k, tiles.shape[0])
    weights, moments, misfits = stack_row(), stack_row(), stack_row()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        for y in range(top, top + TILE_ROWS):
            ru, rv, rvar = right_u[y], right_v[y], right_var[y]
            lu = left_u[y, left:left + TILE_COLUMNS]
            lv = left_v[y, left:left + TILE_COLUMNS]
            lvar = left_var[y, left:left + TILE_COLUMNS]
            dd = d[y, left:left + TILE_COLUMNS]
            out_weight = weight[y, left:left + TILE_COLUMNS]
            out_moment = moment[y, left:left + TILE_COLUMNS]
            out_misfit = misfit[y, left:left + TILE_COLUMNS]
            for x in range(TILE_COLUMNS):
                place = F4(2 * (left - PAD + x)) - dd[x]
                known = (place >= one) & (place < F4(width - 2))
                place = place if known else one
                i = np.int32(place)
                t = place - F4(i)
                i0, i1 = np.uint32(i - 1), np.uint32(i)
                i2, i3 = np.uint32(i + 1), np.uint32(i + 2)
                w0 = sixth * t * (t * (three - t) - two)
                w1 = one + half * t * (t * (t - two) - one)
                w2 = half * t * (two + t * (one - t))
                w3 = sixth * t * (t * t - one)
                g0 = sixth * (t * (F4(6) - three * t) - two)
                g1 = half * (t * (three * t - F4(4)) - one)
                g2 = half * (two + t * (two - three * t))
                g3 = sixth * (three * t * t - one)
                u0, u1, u2, u3 = ru[i0], ru[i1], ru[i2], ru[i3]
                v0, v1, v2, v3 = rv[i0], rv[i1], rv[i2], rv[i3]
                u = w0 * u0 + w1 * u1 + w2 * u2 + w3 * u3
                v = w0 * v0 + w1 * v1 + w2 * v2 + w3 * v3
                gu = g0 * u0 + g1 * u1 + g2 * u2 + g3 * u3
                gv = g0 * v0 + g1 * v1 + g2 * v2 + g3 * v3
                error_u = lu[x] - (m00 * u + m01 * v + m02)
                error_v = lv[x] - (m10 * u + m11 * v + m12)
                slope_u = m00 * gu + m01 * gv
                slope_v = m10 * gu + m11 * gv
                noise = max(rvar[i1], rvar[i2])
                informed = known & (noise < FLAT) & (lvar[x] < FLAT)
                steep = slope_u * slope_u + slope_v * slope_v
                w = one / (scale * (lvar[x] + noise) + JITTER * steep)
                chi = w * (error_u * error_u + error_v * error_v)
                w = w / (one + chi / robust)
                strength = w * steep
                pulled = (strength * (dd[x] - reference)
                          - w * (slope_u * error_u + slope_v * error_v))
                weights[x] = strength if informed else F4(0)
                moments[x] = pulled if informed else F4(0)
                misfits[x] = chi if informed else NAN
            for x in range(TILE_COLUMNS):
                out_weight[x] = weights[x]
                out_moment[x] = moments[x]
                out_misfit[x] = misfits[x]


stack_sums = stack_array(F4, TILE_ROWS, 10, TILE_COLUMNS)  # rows of tiles as in `gated_sums`


@part(forceinline=True, fastmath=FAST)  # the radius is then a constant
def smooth_sums(weight, moment, top, left, radius, sums):
    """
    Window sums of one tile without a gate, first over rows, then over columns.

    radius, at most WIDE_RADIUS; sums is (TILE_ROWS, 10, TILE_COLUMNS), each row as in
    `gated_sums`. From row to row the sums over rows lose one row, move, and gain one.

    """
    wide = TILE_COLUMNS + 2 * radius
    start, stop = left - radius, left + TILE_COLUMNS + radius
    reach = F4(radius)
    w0, w1, w2, z0, z1 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    m0, m1, m2, m3, m4 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    m5, m6, m7, m8, m9 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    count = stack_row()
    for row in (w0, w1, w2, z0, z1, count):
        for x in range(wide):
            row[x] = F4(0)
    for j in range(-radius - 1, radius):  # the window of the row above the tile
        w, z = weight[top + j, start:stop], moment[top + j, start:stop]
        step = F4(j + 1)
        for x in range(wide):
            w0[x] += w[x]
            w1[x] += w[x] * step
            w2[x] += w[x] * (step * step)
            z0[x] += z[x]
            z1[x] += z[x] * step
            count[x] += F4(1) if w[x] > F4(0) else F4(0)
    for y in range(TILE_ROWS):
        row = top + y
        old_w, old_z = weight[row - 1 - radius, start:stop], moment[row - 1 - radius, start:stop]
        new_w, new_z = weight[row + radius, start:stop], moment[row + radius, start:stop]
        for x in range(wide):
            s0 = w0[x] - old_w[x]
            s1 = w1[x] + reach * old_w[x]
            s2 = w2[x] - (reach * reach) * old_w[x]
            t0 = z0[x] - old_z[x]
            t1 = z1[x] + reach * old_z[x]
            w0[x] = s0 + new_w[x]
            w1[x] = s1 - s0 + reach * new_w[x]
            w2[x] = s2 - s1 - s1 + s0 + (reach * reach) * new_w[x]
            z0[x] = t0 + new_z[x]
            z1[x] = t1 - t0 + reach * new_z[x]
            count[x] += (F4(1) if new_w[x] > F4(0) else F4(0)) - (
                F4(1) if old_w[x] > F4(0) else F4(0))
        for x in range(TILE_COLUMNS):
            s0, s1, s3 = F4(0), F4(0), F4(0)
            for i in range(2 * radius + 1):
                step = F4(i - radius)
                s0 += w0[x + i]
                s1 += w0[x + i] * step
                s3 += w0[x + i] * (step * step)
            m0[x], m1[x], m3[x] = s0, s1, s3
        for x in range(TILE_COLUMNS):
            s2, s4, s5, number = F4(0), F4(0), F4(0), F4(0)
            for i in range(2 * radius + 1):
                step = F4(i - radius)
                s2 += w1[x + i]
                s4 += w1[x + i] * step
                s5 += w2[x + i]
                number += count[x + i]
            m2[x], m4[x], m5[x], m9[x] = s2, s4, s5, number
        for x in range(TILE_COLUMNS):
            t0, t1, t2 = F4(0), F4(0), F4(0)
            for i in range(2 * radius + 1):
                step = F4(i - radius)
                t0 += z0[x + i]
                t1 += z0[x + i] * step
                t2 += z1[x + i]
            m6[x], m7[x], m8[x] = t0, t1, t2
        copy_sums((m0, m1, m2, m3, m4, m5, m6, m7, m8, m9), sums[y])


@part()
def copy_sums(rows, sums):
    """Write a tuple of stack rows into the first rows of sums."""
    for k in range(len(rows)):
        row = rows[k]
        for x in range(TILE_COLUMNS):
            sums[k, x] = row[x]


@part(fastmath=FAST)
def gated_sums(weight, moment, d, a, b, y, left, gate, stride, sums):
    """
    Window sums of one tile row over the nodes that lie on the surface of the center.

    A node counts where its own disparity is within `gate` of the plane of the center; of the
    window rows every `stride`-th is looked at. sums is (10, TILE_COLUMNS): the moments 1, x, y,
    xx, xy, yy of weight and 1, x, y of moment, and the number of nodes that weigh something.

    """
    dc = d[y, left:left + TILE_COLUMNS]
    ac = a[y, left:left + TILE_COLUMNS]
    bc = b[y, left:left + TILE_COLUMNS]
    m0, m1, m2, m3, m4 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    m5, m6, m7, m8, m9 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    base, s0, s1, s2 = stack_row(), stack_row(), stack_row(), stack_row()
    t0, t1, count = stack_row(), stack_row(), stack_row()
    for row in (m0, m1, m2, m3, m4, m5, m6, m7, m8, m9):
        for x in range(TILE_COLUMNS):
            row[x] = F4(0)
    for j in range(-RADIUS, RADIUS + 1, stride):
        row_y = F4(j)
        for x in range(TILE_COLUMNS):
            base[x] = dc[x] + bc[x] * row_y
        for row in (s0, s1, s2, t0, t1, count):
            for x in range(TILE_COLUMNS):
                row[x] = F4(0)
        for i in range(-RADIUS, RADIUS + 1):
            step = F4(i)
            w_row = weight[y + j, left + i:left + i + TILE_COLUMNS]
            z_row = moment[y + j, left + i:left + i + TILE_COLUMNS]
            d_row = d[y + j, left + i:left + i + TILE_COLUMNS]
            for x in range(TILE_COLUMNS):
                near = abs(d_row[x] - (base[x] + ac[x] * step)) < gate
                w, z = w_row[x], z_row[x]
                w = w if near else F4(0)
                z = z if near else F4(0)
                s0[x] += w
                s1[x] += w * step
                s2[x] += w * (step * step)
                t0[x] += z
                t1[x] += z * step
                count[x] += F4(1) if w > F4(0) else F4(0)
        for x in range(TILE_COLUMNS):
            m0[x] += s0[x]
            m1[x] += s1[x]
            m2[x] += s0[x] * row_y
            m3[x] += s2[x]
            m4[x] += s1[x] * row_y
            m5[x] += s0[x] * (row_y * row_y)
            m6[x] += t0[x]
            m7[x] += t1[x]
            m8[x] += t0[x] * row_y
            m9[x] += count[x]
    copy_sums((m0, m1, m2, m3, m4, m5, m6, m7, m8, m9), sums)


@part(fastmath=FAST)
def solve_row(sums, d, a, b, noise_weight, ridge, steepest, reference, new_d, new_a, new_b,
              variance):
    """
    Solve the 3 x 3 normal equations of one tile row for the planes (d, a, b).

    The slopes are held by a ridge of `ridge` times the zeroth moment towards their last value.
    variance is that of d at the center for noise of unit misfit; inf without information. Noise
    has gradients, too: what they add to the weights, noise_weight a node, is no information.

    """
    solved_d, solved_a, solved_b, spreads = stack_row(), stack_row(), stack_row(), stack_row()
    for x in range(TILE_COLUMNS):
        known = sums[0, x] > LEAST_WEIGHT
        s0 = max(sums[0, x], LEAST_WEIGHT)
        hold = ridge * s0
        inverse = F4(1) / s0
        mean_x = sums[1, x] * inverse
        mean_y = sums[2, x] * inverse
        xx = sums[3, x] - sums[1, x] * mean_x + hold
        xy = sums[4, x] - sums[1, x] * mean_y
        yy = sums[5, x] - sums[2, x] * mean_y + hold
        tx = sums[7, x] - mean_x * sums[6, x] + hold * a[x]
        ty = sums[8, x] - mean_y * sums[6, x] + hold * b[x]
        inverse_det = F4(1) / (xx * yy - xy * xy)
        slope_x = (tx * yy - ty * xy) * inverse_det
        slope_y = (ty * xx - tx * xy) * inverse_det
        slope_x = min(max(slope_x, -steepest), steepest)
        slope_y = min(max(slope_y, -steepest), steepest)
        solved = sums[6, x] * inverse - mean_x * slope_x - mean_y * slope_y
        spread = (mean_x * mean_x * yy - F4(2) * mean_x * mean_y * xy
                  + mean_y * mean_y * xx) * inverse_det
        solved_d[x] = reference + solved if known else d[x]
        solved_a[x] = slope_x if known else a[x]
        solved_b[x] = slope_y if known else b[x]
        signal = sums[0, x] - noise_weight * sums[9, x]
        known = known & (signal > F4(0.02) * s0)
        spreads[x] = (inverse + spread) * (s0 / signal) if known else F4(np.inf)
    for x in range(TILE_COLUMNS):
        new_d[x] = solved_d[x]
        new_a[x] = solved_a[x]
        new_b[x] = solved_b[x]
        variance[x] = spreads[x]


@part()
def any_above(values, bound):
    """Return whether any entry is larger than a bound; NaN is not."""
    for y in range(values.shape[0]):
        for x in range(values.shape[1]):
            if values[y, x] > bound:
                return True
    return False


@part()
def copy_tile(d, a, b, top, left, new_d, new_a, new_b):
    """Copy the planes of one tile."""
    for y in range(top, top + TILE_ROWS):
        for x in range(left, left + TILE_COLUMNS):
            new_d[y, x] = d[y, x]
            new_a[y, x] = a[y, x]
            new_b[y, x] = b[y, x]


@banded()
def fit_planes(k, weight, moment, d, a, b, tiles, reach, gate, stride, noise_weight, ridge,
               steepest, reference, new_d, new_a, new_b, variance):
    """
    Least-squares planes of all nodes of some tiles.

    reach, int8: radius of the window where a tile needs no gate, RADIUS or WIDE_RADIUS; 0 where
    it needs one.

    """
    first, last = band(k, tiles.shape[0])
    sums = stack_sums()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        right = left + TILE_COLUMNS
        radius = max(np.int64(reach[tile]), RADIUS)
        informed = any_above(weight[top - radius:top + TILE_ROWS + radius,
                                    left - radius:right + radius], F4(0))
        if not informed:
            copy_tile(d, a, b, top, left, new_d, new_a, new_b)
            variance[top:top + TILE_ROWS, left:right] = F4(np.inf)
            continue
        if reach[tile] == WIDE_RADIUS:
            smooth_sums(weight, moment, top, left, WIDE_RADIUS, sums)
        elif reach[tile] == RADIUS:
            smooth_sums(weight, moment, top, left, RADIUS, sums)
        else:
            for y in range(TILE_ROWS):
                gated_sums(weight, moment, d, a, b, top + y, left, gate, stride, sums[y])
        for y in range(top, top + TILE_ROWS):
            solve_row(sums[y - top], d[y, left:right], a[y, left:right], b[y, left:right],
                      noise_weight, ridge, steepest, reference, new_d[y, left:right],
                      new_a[y, left:right], new_b[y, left:right], variance[y, left:right])


@banded(fastmath=FAST)
def find_smooth_tiles(k, d, a, b, misfit, color_variance_, tiles, halo, step, worst, smooth):
    """
    Mark the tiles in and around which one surface fits everywhere.

    No unknown node, no step larger than `step` px between a node and the plane of its left and
    upper neighbors (`halo` nodes around the tile included), and a mean misfit below `worst`.
    Nodes whose color says nothing do not count.

    """
    rows, columns = TILE_ROWS + 2 * halo, TILE_COLUMNS + 2 * halo
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0] - halo, tiles[tile, 1] - halo
        broken = 0
        count = 0
        total = F4(0)
        for y in range(top, top + rows):
            above = d[y - 1, left:left + columns]
            slope = b[y - 1, left:left + columns]
            quiet_above = color_variance_[y - 1, left:left + columns]
            before = d[y, left - 1:left - 1 + columns]
            lean = a[y, left - 1:left - 1 + columns]
            quiet_before = color_variance_[y, left - 1:left - 1 + columns]
            here = d[y, left:left + columns]
            quiet = color_variance_[y, left:left + columns]
            chi = misfit[y, left:left + columns]
            for x in range(columns):
                fits_above = ((abs(here[x] - above[x] - slope[x]) < step)
                              | (quiet_above[x] >= FLAT))
                fits_before = ((abs(here[x] - before[x] - lean[x]) < step)
                               | (quiet_before[x] >= FLAT))
                counts = quiet[x] < FLAT
                broken += 1 if counts & (not (fits_above & fits_before)) else 0
                count += 1 if counts else 0
                value = chi[x] if chi[x] < CEILING else CEILING  # NaN counts as that
                total += value if counts else F4(0)
            if broken > 0:
                break
        smooth[tile] = (broken == 0) & (total <= worst * F4(count))


HALO = 2  # of a cost patch: 3 x 3 mean, then the best of 3 x 3 shifted windows
PATCH_ROWS = TILE_ROWS + 2 * HALO
PATCH_COLUMNS = TILE_COLUMNS + 2 * HALO
stack_tile = stack_array(F4, TILE_ROWS, TILE_COLUMNS)
stack_patch = stack_array(F4, PATCH_ROWS, PATCH_COLUMNS)


@part(fastmath=FAST)
def patch_misfit(left_u, left_v, left_var, right_u, right_v, right_var, matrix, scale, cap, d, a,
                 b, top, left, step_y, step_x, out):
    """
    Truncated misfit of one tile and its halo under the planes of nodes (step_y, step_x) away.

    `cap` where the plane is unknown or leads outside the right image; half of it where the
    right image is too dark to speak for or against.

    """
    width = right_u.shape[1]
    m00, m01, m02 = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    m10, m11, m12 = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    start = left - HALO
    stop = start + PATCH_COLUMNS
    lean_x, lean_y = F4(step_x), F4(step_y)
    misfits = stack_row()
    for py in range(PATCH_ROWS):
        y = top - HALO + py
        dd = d[y + step_y, start + step_x:stop + step_x]
        aa = a[y + step_y, start + step_x:stop + step_x]
        bb = b[y + step_y, start + step_x:stop + step_x]
        lu = left_u[y, start:stop]
        lv = left_v[y, start:stop]
        lvar = left_var[y, start:stop]
        ru, rv, rvar = right_u[y], right_v[y], right_var[y]
        row = out[py]
        for x in range(PATCH_COLUMNS):
            place = F4(2 * (start - PAD + x)) - (dd[x] - aa[x] * lean_x - bb[x] * lean_y)
            known = (place >= F4(0)) & (place < F4(width - 1))
            place = place if known else F4(0)
            i = np.int32(place)
            t = place - F4(i)
            i0, i1 = np.uint32(i), np.uint32(i + 1)
            slope_u, slope_v = ru[i1] - ru[i0], rv[i1] - rv[i0]
            u = ru[i0] + slope_u * t
            v = rv[i0] + slope_v * t
            noise = max(rvar[i0], rvar[i1])
            error_u = lu[x] - (m00 * u + m01 * v + m02)
            error_v = lv[x] - (m10 * u + m11 * v + m12)
            spread = (scale * (lvar[x] + noise)
                      + JITTER * (slope_u * slope_u + slope_v * slope_v))
            chi = (error_u * error_u + error_v * error_v) / spread
            chi = min(chi, cap)
            chi = chi if noise < FLAT else F4(0.5) * cap
            misfits[x] = chi if known else cap
        for x in range(PATCH_COLUMNS):
            row[x] = misfits[x]


@part(fastmath=FAST)
def best_shifted_mean(misfit, mean, cost):
    """
    Write cost, float32 tile: the lowest of the nine 3 x 3 means that contain a node.

    Windows that may shift do not straddle a depth edge. mean is a float32 patch of scratch.

    """
    ninth = F4(1.0 / 9.0)
    for y in range(1, PATCH_ROWS - 1):
        above, here, below = misfit[y - 1], misfit[y], misfit[y + 1]
        row = mean[y]
        for x in range(1, PATCH_COLUMNS - 1):
            row[x] = ninth * (above[x - 1] + above[x] + above[x + 1] + here[x - 1] + here[x]
                              + here[x + 1] + below[x - 1] + below[x] + below[x + 1])
    for y in range(TILE_ROWS):
        above, here, below = mean[y + 1], mean[y + 2], mean[y + 3]
        row = cost[y]
        for x in range(TILE_COLUMNS):
            low = min(min(above[x + 1], above[x + 2]), above[x + 3])
            low = min(low, min(min(here[x + 1], here[x + 2]), here[x + 3]))
            row[x] = min(low, min(min(below[x + 1], below[x + 2]), below[x + 3]))


@banded()
def propagate(k, left_u, left_v, left_var, right_u, right_v, right_var, matrix, scale, cap,
              inertia, d, a, b, tiles, step, judged, new_d, new_a, new_b, cost):
    """
    Let the nodes of some tiles try the planes of their neighbors `step` nodes away.

    A node takes the plane that fits best (see `best_shifted_mean`); its own one is favored by
    `inertia` and costs what cost says if it is `judged`, by an earlier call. Reads d, a, b, writes
    new_* and cost in the tiles only. Tiles without any known plane in reach stay unknown, at a
    cost of `cap`.

    """
    first, last = band(k, tiles.shape[0])
    misfit, mean, trial, best = stack_patch(), stack_patch(), stack_tile(), stack_tile()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        reach = step + HALO
        if not any_above(d[top - reach:top + TILE_ROWS + reach,
                           left - reach:left + TILE_COLUMNS + reach], F4(-np.inf)):
            new_d[top:top + TILE_ROWS, left:left + TILE_COLUMNS] = NAN
            cost[top:top + TILE_ROWS, left:left + TILE_COLUMNS] = cap
            continue
        for candidate in range(5):
            step_y = step * ((candidate == 2) - (candidate == 1))
            step_x = step * ((candidate == 4) - (candidate == 3))
            if candidate == 0 and judged:
                for y in range(TILE_ROWS):
                    for x in range(TILE_COLUMNS):
                        best[y, x] = cost[top + y, left + x]
            else:
                patch_misfit(left_u, left_v, left_var, right_u, right_v, right_var, matrix, scale,
                             cap, d, a, b, top, left, step_y, step_x, misfit)
                best_shifted_mean(misfit, mean, best if candidate == 0 else trial)
            take_better(trial, inertia, d, a, b, top, left, step_y, step_x, candidate == 0,
                        best, new_d, new_a, new_b, cost)


@part(fastmath=FAST)
def take_better(trial, inertia, d, a, b, top, left, step_y, step_x, own, best, new_d, new_a,
                new_b, cost):
    """Write the plane of a candidate where its trial cost beats the best so far."""
    if own:
        copy_tile(d, a, b, top, left, new_d, new_a, new_b)
        for y in range(TILE_ROWS):
            for x in range(TILE_COLUMNS):
                cost[top + y, left + x] = best[y, x]
                best[y, x] -= inertia
        return
    lean_x, lean_y = F4(step_x), F4(step_y)
    best_d, best_a, best_b = stack_row(), stack_row(), stack_row()
    costs, lows = stack_row(), stack_row()
    for y in range(TILE_ROWS):
        source, start = top + y + step_y, left + step_x
        old_d = d[source, start:start + TILE_COLUMNS]
        old_a = a[source, start:start + TILE_COLUMNS]
        old_b = b[source, start:start + TILE_COLUMNS]
        row_d = new_d[top + y, left:left + TILE_COLUMNS]
        row_a = new_a[top + y, left:left + TILE_COLUMNS]
        row_b = new_b[top + y, left:left + TILE_COLUMNS]
        row_cost = cost[top + y, left:left + TILE_COLUMNS]
        trials, bests = trial[y], best[y]
        for x in range(TILE_COLUMNS):
            better = trials[x] < bests[x]
            slope_x, slope_y = old_a[x], old_b[x]
            moved = old_d[x] - slope_x * lean_x - slope_y * lean_y
            last_d, last_a, last_b, last_cost = row_d[x], row_a[x], row_b[x], row_cost[x]
            best_d[x] = moved if better else last_d
            best_a[x] = slope_x if better else last_a
            best_b[x] = slope_y if better else last_b
            costs[x] = trials[x] if better else last_cost
            lows[x] = trials[x] if better else bests[x]
        for x in range(TILE_COLUMNS):
            row_d[x] = best_d[x]
            row_a[x] = best_a[x]
            row_b[x] = best_b[x]
            row_cost[x] = costs[x]
            bests[x] = lows[x]


@njit(cache=True, nogil=True, error_model='numpy', fastmath=FAST)
def add_color_sums(left_u, left_v, right_u, right_v, d, misfit, worst, rows, columns, step_y,
                   step_x, normal, target):
    """
    Add x x^T to normal (3, 3) and x y^T to target (3, 2), float64, of matched colors.

    x = (u, v, 1) at the place of a node in the right image (linear interpolation), y = (u, v) of
    the node. Every step_y-th row and step_x-th column counts, from the second on, where the
    misfit is below `worst`.

    """
    width = right_u.shape[1]
    for y in range(PAD + 1, PAD + rows, step_y):
        for x in range(PAD + 1, PAD + columns, step_x):
            if not misfit[y, x] < worst:
                continue
            place = F4(2 * (x - PAD)) - d[y, x]
            i = min(max(np.int32(place), np.int32(0)), np.int32(width - 2))
            t = place - F4(i)
            u = right_u[y, i] + t * (right_u[y, i + 1] - right_u[y, i])
            v = right_v[y, i] + t * (right_v[y, i + 1] - right_v[y, i])
            color, goal = (u, v, F4(1)), (left_u[y, x], left_v[y, x])
            for row in range(3):
                for column in range(3):
                    normal[row, column] += color[row] * color[column]
                for column in range(2):
                    target[row, column] += color[row] * goal[column]


@njit(cache=True, nogil=True, error_model='numpy', fastmath=FAST)
def brightness_balance(d, misfit, left_s, right_s, step, worst, balance, weight):
    """
    Compare the brightness of every step-th node with that of its place in the right image.

    balance, float32 (h, w), takes (left - right) / (left + right), weight 1 where the misfit is
    below `worst` and 0 elsewhere; balance is 0 there.

    """
    width = right_s.shape[1]
    for row in range(balance.shape[0]):
        y = PAD + row * step + step // 2
        for column in range(balance.shape[1]):
            x = column * step + step // 2
            place = F4(2 * x) - d[y, x + PAD]
            known = (misfit[y, x + PAD] < worst) & (place >= F4(0)) & (place < F4(width - 1))
            at = np.int32(place if known else F4(0))
            found = imbalance(left_s[y, x + PAD], right_s[y, at])
            balance[row, column] = found if known else F4(0)
            weight[row, column] = F4(1) if known else F4(0)


@part(fastmath=FAST)
def imbalance(left, right):
    """Return the difference of two brightnesses (DN) over their sum, steadied near black."""
    return (left - right) / (left + right + F4(2) * MURK)


@banded(fastmath=FAST)
def judge(k, d, a, b, cost, misfit, variance, left_s, right_s, balance, rows, columns, model,
          evidence, trust):
    """
    Log-odds that a node is right within 1 px, from how well its plane fits.

    evidence, float32 (5, rows, columns): square roots of the cost of the best shifted window,
    of the mean misfit of the 3 x 3 nodes, of the standard deviation (px), of the mean distance
    of the four neighbors from the plane (px), and of how far the `imbalance` of left and right
    brightness is from `balance`, float32 (rows, columns), that of the surroundings; roots, since
    logarithms are not vectorized. With x = (1, evidence), trust = x . model x, framed; model is
    float32 (6, 6), upper triangular. UNKNOWN where d is unknown or nothing tells it.

    """
    ninth, quarter = F4(1.0 / 9.0), F4(0.25)
    last_place = F4(right_s.shape[1] - 1)
    first, last = band(k, rows)
    e0, e1, e2, e3 = stack_row(), stack_row(), stack_row(), stack_row()
    e4, log_odds = stack_row(), stack_row()
    for row in range(first, last):
        y = row + PAD
        bright = right_s[y]
        for start in range(0, columns, TILE_COLUMNS):
            left, count = start + PAD, min(TILE_COLUMNS, columns - start)
            right = left + count
            above, below = d[y - 1, left:right], d[y + 1, left:right]
            here = d[y, left - 1:right + 1]
            lean_x, lean_y = a[y, left:right], b[y, left:right]
            chi0 = misfit[y - 1, left - 1:right + 1]
            chi1 = misfit[y, left - 1:right + 1]
            chi2 = misfit[y + 1, left - 1:right + 1]
            fit, spread = cost[y, left:right], variance[y, left:right]
            own_s, usual = left_s[y, left:right], balance[row, start:start + count]
            for x in range(count):
                total = F4(0)
                for i in range(3):
                    total += capped(chi0[x + i]) + capped(chi1[x + i]) + capped(chi2[x + i])
                center = here[x + 1]
                apart = (apartness(here[x + 2] - center - lean_x[x])
                         + apartness(here[x] - center + lean_x[x])
                         + apartness(below[x] - center - lean_y[x])
                         + apartness(above[x] - center + lean_y[x]))
                place = F4(2 * (start + x)) - center
                place = place if (place >= F4(0)) & (place < last_place) else F4(0)
                at = np.int32(place)
                low, high = bright[np.uint32(at)], bright[np.uint32(at + 1)]
                other = low + (high - low) * (place - F4(at))
                e0[x] = math.sqrt(capped(fit[x]))
                e1[x] = math.sqrt(total * ninth)
                e2[x] = math.sqrt(math.sqrt(min(spread[x], F4(1))))
                e3[x] = math.sqrt(quarter * apart)
                e4[x] = math.sqrt(min(abs(imbalance(own_s[x], other) - usual[x]), F4(1)))
                known = (center == center) & (spread[x] < F4(np.inf))
                odds = quadratic(model, e0[x], e1[x], e2[x], e3[x], e4[x])
                log_odds[x] = odds if known else UNKNOWN
            for x in range(count):
                evidence[0, row, start + x] = e0[x]
                evidence[1, row, start + x] = e1[x]
                evidence[2, row, start + x] = e2[x]
                evidence[3, row, start + x] = e3[x]
                evidence[4, row, start + x] = e4[x]
                trust[y, left + x] = log_odds[x]


@part(fastmath=FAST)
def quadratic(m, a, b, c, d, e):
    """Return x . m x of x = (1, a, b, c, d, e) and an upper triangular m."""
    return (m[0, 0]
            + a * (m[0, 1] + m[1, 1] * a + m[1, 2] * b + m[1, 3] * c + m[1, 4] * d + m[1, 5] * e)
            + b * (m[0, 2] + m[2, 2] * b + m[2, 3] * c + m[2, 4] * d + m[2, 5] * e)
            + c * (m[0, 3] + m[3, 3] * c + m[3, 4] * d + m[3, 5] * e)
            + d * (m[0, 4] + m[4, 4] * d + m[4, 5] * e)
            + e * (m[0, 5] + m[5, 5] * e))


@part(fastmath=FAST)
def capped(misfit):
    """Return a misfit, at most CEILING; NaN counts as that."""
    return misfit if misfit < CEILING else CEILING


@part(fastmath=FAST)
def apartness(difference):
    """Return the magnitude of a difference, at most 2 px; NaN counts as that."""
    size = abs(difference)
    return size if size < F4(2) else F4(2)


@part()
def root_of(parent, node):
    """Return the representative of a node's segment, and shorten the path to it."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@njit(cache=True, nogil=True, error_model='numpy')
def remove_islands(d, a, b, trust, s, bright, rows, columns, step, least_size, run_of, first,
                   parent, size):
    """
    Distrust small segments: set trust to ISLAND where fewer than least_size nodes hang together.

    Two neighbors hang together if both have positive trust and one lies within `step` px of the
    plane of the other. A node whose brightness s is below `bright` (DN) counts for as much less:
    dark nodes match by chance, and many must agree. Segments are found by runs: nodes of one row
    that hang together. run_of, first, parent and size are int32 scratch (rows * columns).

    """
    ends = np.empty(BANDS, I4)
    join_nodes(d, a, b, trust, s, bright, rows, columns, step, run_of, first, parent, size, ends)
    for k in range(1, BANDS):
        join_bands(d, b, trust, band(k, rows)[0], columns, step, run_of, parent)
    for k in range(BANDS):
        for run in range(band(k, rows)[0] * columns, ends[k]):
            root = root_of(parent, run)
            if root != run:
                size[root] += size[run]
    for k in range(BANDS):
        for run in range(band(k, rows)[0] * columns, ends[k]):
            if size[root_of(parent, run)] < WHOLE * least_size:
                node = first[run]
                while node < rows * columns and run_of[node] == run:
                    trust[node // columns + PAD, node % columns + PAD] = ISLAND
                    node += 1


@banded(fastmath=FAST)
def join_nodes(k, d, a, b, trust, s, bright, rows, columns, step, run_of, first, parent, size,
               ends):
    """
    Join the nodes of each band to runs and the runs to segments; see `remove_islands`.

    The runs of a band are counted from its first node on, ends is where that ends. size is in
    parts of a bright node, WHOLE of which make one.

    """
    first_row, last_row = band(k, rows)
    runs = first_row * columns
    # 1 trusted, + 2 hangs together with the left, + 4 with the upper node, + 8 times the size
    links = stack_row()
    whole, one = F4(WHOLE), F4(1)
    parts = whole / bright
    for row in range(first_row, last_row):
        y = row + PAD
        last_run, last_above = -1, -1
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            left, right = start + PAD, start + PAD + count
            here, before, above = d[y, left:right], d[y, left - 1:right - 1], d[y - 1, left:right]
            lean, lean_before = a[y, left:right], a[y, left - 1:right - 1]
            fall, fall_above = b[y, left:right], b[y - 1, left:right]
            own, trust_before = trust[y, left:right], trust[y, left - 1:right - 1]
            trust_above, light = trust[y - 1, left:right], s[y, left:right]
            for x in range(count):
                trusted = own[x] > 0
                step_x, step_y = here[x] - before[x], here[x] - above[x]
                with_left = trusted & (trust_before[x] > 0) & (
                    (abs(step_x - lean_before[x]) < step) | (abs(step_x - lean[x]) < step))
                with_upper = trusted & (trust_above[x] > 0) & (
                    (abs(step_y - fall_above[x]) < step) | (abs(step_y - fall[x]) < step))
                weight = F4(I4(max(min(parts * light[x], whole), one)))
                links[x] = ((F4(1) + F4(8) * weight if trusted else F4(0))
                            + (F4(2) if with_left else F4(0)) + (F4(4) if with_upper else F4(0)))
            for x in range(count):
                node = row * columns + start + x
                link = np.int32(links[x])
                if link == 0:
                    run_of[node] = -1
                    continue
                if link & 2:
                    run = run_of[node - 1]
                    size[run] += link >> 3
                else:
                    run = runs
                    first[run] = node
                    parent[run] = run
                    size[run] = link >> 3
                    runs += 1
                run_of[node] = run
                if link & 4 and row > first_row:
                    upper = run_of[node - columns]
                    if upper != last_above or run != last_run:
                        last_run, last_above = run, upper
                        parent[root_of(parent, run)] = root_of(parent, upper)
    ends[k] = runs


@part()
def join_bands(d, b, trust, row, columns, step, run_of, parent):
    """Join the runs of a row to those of the row above, which belongs to another band."""
    y = row + PAD
    if row == 0 or row * columns >= run_of.size:
        return
    for x in range(columns):
        here, above = x + PAD, row * columns + x - columns
        change = d[y, here] - d[y - 1, here]
        if trust[y, here] > 0 and trust[y - 1, here] > 0 and (
                abs(change - b[y - 1, here]) < step or abs(change - b[y, here]) < step):
            parent[root_of(parent, run_of[above + columns])] = root_of(parent, run_of[above])


@part()
def whole_below(value):
    """Return the largest whole number up to a value, float32: math.floor is a call."""
    whole = F4(np.int32(value))
    return whole - F4(1) if whole > value else whole


@banded()
def find_hidden(k, d, a, trust, rows, columns, width, tolerance, hidden, owners, trusts):
    """
    Mark nodes whose place in the right image belongs to a more trusted surface.

    Every node covers the right columns that its footprint reaches; per column the most trusted
    node is kept. A node is hidden where that node's surface, continued along its own plane,
    does not pass through it. owners, int32, and trusts, float32, are scratch (BANDS, width).

    """
    first, last = band(k, rows)
    owner, most = owners[k], trusts[k]
    flags, lows, highs = stack_row(), stack_row(), stack_row()
    for row in range(first, last):
        y = row + PAD
        dd, aa = d[y, PAD:PAD + columns], a[y, PAD:PAD + columns]
        own = trust[y, PAD:PAD + columns]
        marks = hidden[y, PAD:PAD + columns]
        owner[:] = -1
        most[:] = ISLAND
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            places, leans = dd[start:start + count], aa[start:start + count]
            for i in range(count):
                center = F4(2 * (start + i)) - (places[i] if places[i] == places[i] else F4(0))
                reach = min(max(F4(0.5), F4(1) - F4(0.5) * leans[i]), F4(4))
                lows[i] = -whole_below(reach - center)
                highs[i] = whole_below(center + reach)
            for i in range(count):
                x = start + i
                if own[x] > ISLAND:
                    low = max(np.int32(lows[i]), np.int32(0))
                    high = min(np.int32(highs[i]), np.int32(width - 1))
                    for at in range(low, high + 1):
                        if own[x] > most[at]:
                            most[at] = own[x]
                            owner[at] = x
        for start in range(0, columns, TILE_COLUMNS):
            count = min(TILE_COLUMNS, columns - start)
            for i in range(count):
                x = start + i
                known = own[x] > ISLAND
                place = whole_below(F4(2 * x) + F4(0.5) - (dd[x] if known else F4(0)))
                known = known & (place >= 0) & (place < width)
                rival = owner[np.uint32(place if known else 0)]
                known = known & (rival >= 0)
                at = np.uint32(rival if known else 0)
                away = F4(x) - F4(rival)
                apart = abs(dd[at] + aa[at] * away - dd[x])
                flags[i] = F4(1) if known & (
                    apart > tolerance + F4(0.25) * abs(away)) else F4(0)
            for i in range(count):
                marks[start + i] = flags[i] > F4(0)


@banded(fastmath=FAST)
def settle(k, d, variance, evidence, cost, trust, hidden, peak, s, rows, columns, limits,
           saturation, dark, hidden_odds, vague, std, odds, reason):
    """
    Turn evidence into log-odds, standard deviation and the reason why there may be no range.

    limits (px): of the disparity. hidden_odds is added to the log-odds of hidden nodes. vague
    (px): the standard deviation of a plane from which on the colors around a node are too uniform
    to tell. The standard deviation grows with the distance of the neighbors from the plane: there
    a plane is not what the surface is. odds is HOPELESS where no min_confidence lets a range pass;
    it gets a frame of the nearest nodes left and right. reason takes the codes of types.Status.

    """
    too_vague = vague * vague
    lowest, highest = limits[0], limits[1]
    first, last = band(k, rows)
    spreads, sums, codes = stack_row(), stack_row(), stack_row()
    for row in range(first, last):
        y = row + PAD
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            left, right = start + PAD, start + PAD + count
            dd, noise, fit = d[y, left:right], variance[y, left:right], cost[y, left:right]
            trusts, behind = trust[y, left:right], hidden[y, left:right]
            peaks, light = peak[y, left:right], s[y, left:right]
            aparts = evidence[3, row, start:start + count]
            for x in range(count):
                is_hidden = behind[x] != 0
                apart = BENT * aparts[x] * aparts[x]
                spread = math.sqrt(CORRELATED * noise[x] + apart * apart)
                vaguer = noise[x] > too_vague
                bright = peaks[x] >= saturation
                outside = peaks[x] < F4(0)
                inside_limits = (dd[x] >= lowest) & (dd[x] <= highest)  # not if NaN
                # the first reason in the order of looking wins: it is asked for last
                code = NO_MATCH if fit[x] > F4(0.3) * CEILING else IMPLAUSIBLE
                code = AMBIGUOUS if spread > vague else code
                code = INCONSISTENT if is_hidden else code
                code = code if inside_limits else OUT_OF_RANGE
                code = AMBIGUOUS if vaguer else code
                code = code if dd[x] == dd[x] else NO_MATCH
                code = DARK if (light[x] < dark) & (not bright) else code
                code = SATURATED if bright else code
                code = OUTSIDE_IMAGE if outside else code
                hopeless = (outside | vaguer | (not inside_limits) | (trusts[x] < -MOST_ODDS)
                            | ((light[x] < PITCH_DARK) & (not bright)))
                spreads[x] = spread
                sums[x] = HOPELESS if hopeless else (
                    trusts[x] + (hidden_odds if is_hidden else F4(0)))
                codes[x] = F4(code)
            for x in range(count):
                std[y, left + x] = spreads[x]
                odds[y, left + x] = sums[x]
                reason[y, left + x] = np.uint8(codes[x])
        odds[y, PAD - 1] = odds[y, PAD]
        odds[y, PAD + columns] = odds[y, PAD + columns - 1]


@part(fastmath=FAST)
def logistic(odds):
    """
    Return 1 / (1 + exp(-odds)), to 1e-5 of the smaller of probability and improbability.

    exp(x) = exp(x / 32)^32 with a polynomial, since a call of the library is not vectorized.

    """
    x = min(max(-odds, F4(-16)), F4(16)) * F4(1 / 32)
    power = F4(1) + x * (F4(1) + x * (F4(1 / 2) + x * (F4(1 / 6) + x * (
        F4(1 / 24) + x * (F4(1 / 120) + x * F4(1 / 720))))))
    power *= power
    power *= power
    power *= power
    power *= power
    power *= power
    return F4(1) / (F4(1) + power)


@part(fastmath=FAST)
def bounded(odds):
    """Return log-odds within what interpolation may take over from a neighbor."""
    return min(max(odds, LEAST_ODDS), MOST_ODDS)


@banded(fastmath=FAST)
def expand(k, d, a, b, std, odds, reason, rows, columns, limits, focal_baseline, offset,
           least_odds, disparity, depth, out_std, out_confidence, out_status):
    """
    Evaluate the planes of the nodes at every pixel, decide which count, and triangulate.

    Z = focal_baseline / (d - offset). Log-odds of a pixel: OWN_SHARE of its node's, the rest
    bilinear between the nodes around, so that a pixel next to doubtful nodes is doubted more than
    that on the other side of its node; below least_odds it has no range. Pixels beyond the last
    whole node take the nearest one. Where there is no range, disparity, depth and out_std are NaN
    and confidence is 0.

    """
    height, width = disparity.shape
    lowest, highest = limits[0], limits[1]
    near, far, shared = F4(0.75), F4(0.25), F4(1) - OWN_SHARE
    first, last = band(k, height)
    mixed = stack_row()
    even = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    odd = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    for v in range(first, last):
        row = min(v >> 1, rows - 1)
        below = v > 2 * row
        y, other = row + PAD, min(max(row + (1 if below else -1), 0), rows - 1) + PAD
        lean_y = F4(0.5) * (F4(v - 2 * row) - F4(0.5))
        for start in range(0, columns, TILE_COLUMNS):
            count = min(TILE_COLUMNS, columns - start)
            left, right = start + PAD, start + PAD + count
            here, there = odds[y, left - 1:right + 1], odds[other, left - 1:right + 1]
            dd, aa, bb = d[y, left:right], a[y, left:right], b[y, left:right]
            noise, reasons = std[y, left:right], reason[y, left:right]
            for x in range(count + 2):
                mixed[x] = near * bounded(here[x]) + far * bounded(there[x])
            # an odd last column has no node of its own
            sides = 3 if (right == columns + PAD) & (width > 2 * columns) else 2
            for side in range(sides):
                values, depths, spreads, certainties, codes = odd if side == 1 else even
                lean_x = F4(0.5) * (F4(side) - F4(0.5))
                beside = 2 * min(side, 1)  # the neighbor in mixed
                for x in range(count):
                    value = dd[x] + aa[x] * lean_x + bb[x] * lean_y
                    certainty = OWN_SHARE * bounded(here[x + 1]) + shared * (
                        near * mixed[x + 1] + far * mixed[x + beside])
                    sure = (certainty >= least_odds) & (here[x + 1] > HOPELESS)
                    valid = sure & (value >= lowest) & (value <= highest)
                    code = OUT_OF_RANGE if sure else reasons[x]
                    values[x] = value if valid else NAN
                    depths[x] = focal_baseline / (value - offset) if valid else NAN
                    spreads[x] = noise[x] if valid else NAN
                    certainties[x] = logistic(certainty) if valid else F4(0)
                    codes[x] = F4(VALID if valid else code)
                if side == 1:
                    begin, end = 2 * start, 2 * (start + count)
                    interleave(even[0], odd[0], disparity[v, begin:end])
                    interleave(even[1], odd[1], depth[v, begin:end])
                    interleave(even[2], odd[2], out_std[v, begin:end])
                    interleave(even[3], odd[3], out_confidence[v, begin:end])
                    interleave(even[4], odd[4], out_status[v, begin:end])
                if side == 2:
                    at = count - 1
                    disparity[v, width - 1], depth[v, width - 1] = values[at], depths[at]
                    out_std[v, width - 1] = spreads[at]
                    out_confidence[v, width - 1] = certainties[at]
                    out_status[v, width - 1] = np.uint8(codes[at])


@part()
def interleave(even, odd, out):
    """Write the numbers of two stack rows in turn."""
    for x in range(out.size // 2):
        out[2 * x] = even[x]
        out[2 * x + 1] = odd[x]
