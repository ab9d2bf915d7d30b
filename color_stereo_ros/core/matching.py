# SPDX-License-Identifier: Apache-2.0
"""The choice of the matching method."""


def make_matcher(settings, geometry, limits):
    """
    Return the matcher that settings.matching.method names.

    Parameters
    ----------
    settings : Settings
    geometry : RectifiedGeometry
    limits : (float, float)
        Smallest and largest disparity, px.

    Returns
    -------
    matcher : object
        With one method, `match(pair)`: RectifiedPair in, Match out.

    """
    if settings.matching.method == 'paper':
        from .paper import PaperMatcher
        return PaperMatcher(settings, geometry, limits)
    from .surface import SurfaceMatcher
    return SurfaceMatcher(settings, geometry, limits)
