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
"""
The surface method: coarse to fine, with a slanted plane at every node.

1. colors: each image is rectified at half resolution (the right one keeps its columns) and
   turned into chromaticity with a variance.
2. coarse: semi-global search over all disparities, on a sixteenth of the pixels or fewer. Its
   disparities are the seeds of the planes.
3. Rounds, `matching.refinements` of them:

   - propagate (from the second round on): nodes near depth edges try the planes of neighbors;
   - fit: least squares of a plane at every node, from the gradient of the chromaticity;
   - compare: the nodes are compared again under the new planes; the first round measures noise
     and colors of the pair from that;
   - polish (from the second round on): wide windows where this round has made tiles smooth.

4. rows: by how much the rows of the two views disagree. If that matters, the right view is read
   elsewhere and the pair is matched again, see `aligning`.
5. bend: planes of surfaces that bend within a window are put in the right place.
6. judge: small windows tell which plane nodes beside steps belong to, where seeds hold the
   planes or the pair says little; how well planes fit corrects their variance; then log-odds,
   standard deviation and reason of every node. What is hidden from the right camera, fits
   badly or is too uncertain gets no range.
7. expand: from nodes to pixels.

These are the names of the stages in `RangeResult.seconds`; those of a round carry its number.
The time of all but the coarse stage does not depend on the number of disparities. Every stage owns
its buffers and takes what it reads as arguments. It returns what it wrote, or its docstring says
what it changes in place. `grid_kernels` explains the half grid.

"""

from dataclasses import replace
from functools import partial

import numpy as np

from .aligning import Aligner, doubt
from .bends import Bends
from .brightness import BrightnessCarrier, without_color
from .coarse import CoarseSearch
from .contest import Contest
from .even import Evening, median_slope
from .grid import HalfGrid
from .grid_kernels import F4, SILENT_VARIANCE
from .neighbors import propagate_planes, rough_tiles
from .pair_model import color_matrix, PairModel, sampled_lines, worst_part
from .pixels import measured_pixels
from .planes import LeastSquares, PlaneField
from .quality import Quality
from .rows import RowTracker
from .shared import SharedErrors
from .steps import Steps
from .texture import (
    clear_share, color_detail, colors_of, detail, details_show, TextureSearch)
from .third.following import allow_third_view, Follower
from .third.view import ThirdView
from .trust import Trust
from .tuning import careful_tuning, detailed_tuning, slow_tuning, tuning_for
from .views import Views
from ..compiled import Arena
from ..patterns.expectation import Expectation
from ..projector.finding import Reason
from ..rows.alignment import COUNT


class SurfaceMethod:
    """
    Measures the pairs of one rig.

    Parameters
    ----------
    settings : Settings
    calibration : StereoCalibration
    limits : (float, float)
        Smallest and largest disparity, px.
    rectified_input : bool
        The images arrive rectified already.
    tuning : Tuning, optional
        Default: what suits the pattern.
    expectation : Expectation, optional
        What is expected of the pattern; default: what the settings say.

    """

    aligns_rows = True
    """`measure` takes what is known of rows and projector, and returns what the pair shows."""

    def __init__(self, settings, calibration, limits, rectified_input=False, tuning=None,
                 expectation=None):
        """Build the maps and allocate the buffers of all steps, in the order of the pipeline."""
        self.settings = settings
        self.geometry = calibration.geometry
        self.limits = np.array(limits, F4)
        grid = HalfGrid(self.geometry.height, self.geometry.width)
        arena = Arena()
        self.expectation = expectation or Expectation.of(settings.pattern)
        if tuning is None:
            tuning = tuning_for(self.expectation, self.geometry.width)
        self.tuning = tuning
        self.views = Views(calibration, grid, settings, tuning, rectified_input, arena)
        self.coarse = CoarseSearch(grid.nodes, grid.width, limits, settings.matching, tuning,
                                   arena)
        self.texture = TextureSearch(grid, limits, tuning)
        self.brightness = BrightnessCarrier(self.views, tuning, arena)
        self.in_force = tuning
        self.found = None
        self.detailed = detailed_tuning(tuning)
        self.slow = slow_tuning(tuning, self.geometry.width)
        self.planes = PlaneField(grid, tuning.coarse.seed_variance,
                                 settings.matching.refinements > 0, arena)
        self.least_squares = LeastSquares(grid, limits, settings.matching, tuning.planes,
                                          arena)
        self.bends = Bends(grid, tuning.bends, arena)
        self.quality = Quality(grid, tuning.quality, arena)
        self.trust = Trust(grid, self.limits, settings, tuning, arena)
        self.steps = Steps(grid, tuning)
        self.contest = Contest(grid, tuning, arena)
        self.shared = SharedErrors(grid, tuning.shared)
        self.rows = RowTracker(grid, tuning, arena)
        choice = settings.matching.row_alignment
        self.aligner = None if choice == 'off' else Aligner(
            (grid.width, grid.height), choice == 'correct',
            turning=settings.health.correct != 'off')
        self.evening = Evening(settings.matching, tuning)
        self.detailed_evening = Evening(settings.matching, self.detailed)
        self.careful_evening = Evening(settings.matching, careful_tuning(self.detailed))
        self.slow_evening = Evening(settings.matching, self.slow)
        self.third = self.follower = None
        if settings.matching.refinements:
            self.warm_refinements()
        self.warm_brightness()
        if self.may_use_projector:
            self.third = ThirdView(self, Arena())
            self.third.warm(self.planes, self.trust.verdict)
            self.follower = Follower(self.geometry, self.limits)

    def warm_refinements(self):
        """Run the kernels of colors and bends: the black pair has nothing to match or unbend."""
        views, planes, solver = self.views, self.planes, self.least_squares
        color_matrix(views, planes, F4(1), self.tuning)
        self.bends.unbend(solver.linearized, views, planes, PairModel.neutral(views), solver,
                          planes.tiles[:1], np.ones(1, F4), self.linearize)
        self.steps.lower(planes, self.trust.verdict, self.steps.roughness(self.quality), 0.0)

    def warm_brightness(self):
        """Run the kernels of pairs whose brightness counts: the black pair shows no detail."""
        views, planes, brightness = self.views, self.planes, self.brightness
        brightness.load(views)
        found = self.texture.search(views, False)
        self.coarse.rival_share()
        self.coarse.period_odds(found)
        views.average(self.slow.views.averaging_radius, 0.0)
        brightness.rely_on(found, views.grid)
        self.settle_disputes(views, planes, found)
        neutral = PairModel.neutral(views)
        self.linearize(views, planes.seed(found), neutral, planes.tiles[:1])
        if self.settings.matching.refinements:  # slow colors without detail ask for none of this
            self.suit(self.detailed)
            self.bends.correct(self.least_squares.linearized, views, planes, neutral,
                               self.least_squares, self.linearize)
            self.quality.sample(self.least_squares.linearized, planes,
                                self.least_squares.reference)
            self.quality.correct_variance(planes)
            self.suit(self.tuning)
        brightness.rest()

    def measure(self, left, right, clock, alignment=None, search=None, given=None):
        """
        Measure one pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        clock : Stopwatch
            Told when a stage ends, and what it wrote.
        alignment : Alignment, optional
            What is known of the rows of the views.
        search : callable, optional
            See `Aligner.align`.
        given : Given, optional
            What is known of the projector; None: two views measure.

        Returns
        -------
        measurement : Measurement

        """
        raw = left, right
        left, right, looks = self.alike(left, right)
        if self.aligner is None:
            alignment = None
            pair, seeds = self.match(left, right, np.zeros(COUNT), clock, looks)
        else:
            alignment, pair, seeds = self.match_aligned(left, right, looks, alignment, search,
                                                        clock)
        views, planes = self.views, self.planes
        self.bend(views, planes, pair, clock)
        uneven = self.uneven(planes)  # of the fit: seeds are rougher
        if self.brightness.seeded:
            self.settle_disputes(views, planes, seeds)
        balance = self.trust.usual_balance(views, planes)
        verdict = self.judge(views, planes, seeds, balance, uneven, self.brightness.seeded)
        if self.settings.matching.refinements:
            verdict = self.doubt_steps(views, planes, seeds, balance, uneven, verdict)
        if self.aligner is not None and not (
                seeds.alike_share > self.tuning.brightness.agreeing_share):
            verdict.log_odds[:] -= F4(doubt(alignment))
        self.make_std_true(verdict, planes, pair, alignment)
        same = identical(*raw)
        if same:  # at disparity 0 there is nothing to measure
            np.minimum(verdict.log_odds, F4(0), out=verdict.log_odds)
        clock.lap('judge', verdict)
        if self.follower is None or given is None:
            measurement = self.of_two(verdict)
        elif same or self.plain:
            track = self.follower.passed(given, None if same else Reason.PLAIN)
            measurement = replace(self.of_two(verdict), projector=track)
        else:
            measurement = self.with_third_view(verdict, pair, given, clock)
        clock.lap('expand', measurement)
        return replace(measurement, alignment=alignment, rival_share=self.rival_share)

    @property
    def plain(self):
        """Return whether the pair in force shows no colors of the pattern."""
        repeats = self.gray or self.rival_share > 0 or not self.expectation.aperiodic
        return self.brightness.seeded and repeats and not self.views.raised

    @property
    def evening_in_force(self):
        """Return the Evening for what the pair in force shows."""
        if self.in_force is self.slow:
            return self.slow_evening
        return self.detailed_evening if self.in_force is self.detailed else self.evening

    @property
    def planar(self):
        """Return whether the disparities of a node lie on a plane fitted to the images."""
        return self.settings.matching.refinements > 0 and self.settings.matching.slanted

    @property
    def may_use_projector(self):
        """Return whether settings and pattern allow a third view."""
        return allow_third_view(self.settings)

    def of_two(self, verdict, lines=None):
        """Return what two cameras measure; lines: the rows of pixels, int64 (N,), None = all."""
        return measured_pixels(self.planes, verdict, self.geometry, self.limits,
                               self.trust.least_odds, lines=lines)

    def with_third_view(self, verdict, pair, given, clock):
        """
        Return what two cameras and projector measure; two where the projector takes no part.

        Parameters
        ----------
        verdict : Verdict
            Of the two cameras; stays as it is.
        pair : PairModel
            What the two views of the pair differ by.
        given : Given
            What is known of the projector before the pair.
        clock : Stopwatch
            Takes the durations of the stages.

        Returns
        -------
        measurement : Measurement

        """
        track = self.follower.followed(given, partial(self.of_two, verdict))
        clock.lap('projector', track)
        fused = None
        if track.usable:
            self.third.adopt(track.model, track.prepared, given.pattern)
            fused = self.third.fused(self.planes, verdict, self.least_squares.linearized, pair)
            clock.lap('third view', fused)
            track = track.but(explains=fused is not None)
        measurement = self.of_two(verdict) if fused is None else self.expanded(fused)
        return replace(measurement, projector=track)

    def measure_left(self, left, clock, given):
        """
        Measure with left camera and projector, without the right camera.

        Parameters
        ----------
        left : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB image.
        clock : Stopwatch
            Takes the durations of the stages.
        given : Given
            Its track has a model.

        Returns
        -------
        measurement : Measurement

        """
        track = given.track
        if track.prepared is None:
            track = self.follower.prepared(track.but(agreeing=True))
        raised = self.views.raised  # in the last pair
        views = self.views.load(left, left, np.zeros(COUNT))
        if raised:
            views.raise_faint_colors()
        clock.lap('colors', views)
        self.third.adopt(track.model, track.prepared, given.pattern)
        if not np.isfinite(track.smoothing):  # nobody has searched
            track = track.but(smoothing=self.third.projected.blur)
        fused = self.third.measure_alone(PairModel.neutral(views))
        clock.lap('third view', fused)
        measurement = self.expanded(fused)
        clock.lap('expand', measurement)
        measurement = self.follower.alone(given, track, measurement)
        clock.lap('projector', measurement)
        return measurement

    def expanded(self, fused):
        """
        Return the Measurement of the nodes of three views.

        What the views measure by turns leaves islands, too: chance matches of two cameras amid a
        surface that only the projector sees.

        """
        self.trust.distrust_islands(self.views, fused.planes, fused.verdict.log_odds)
        measurement = measured_pixels(fused.planes, fused.verdict, self.geometry, self.limits,
                                      self.trust.least_odds, fused.beyond)
        return replace(measurement, views=fused.views_of(measurement.status))

    def bend(self, views, planes, pair, clock):
        """
        Put planes of bent surfaces in the right place; variances know what colors share.

        Writes d, a, b, variance and misfit of planes.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            After all rounds.
        pair : PairModel
            What the two views of the pair differ by.
        clock : Stopwatch
            Takes the durations of the stages.

        """
        solver = self.least_squares
        if self.settings.matching.refinements:
            self.bends.correct(solver.linearized, views, planes, pair, solver, self.linearize)
            clock.lap('bend', planes)
        solver.correct_variance(planes)

    def judge(self, views, planes, seeds, balance, uneven, contested):
        """Return the Verdict on the planes, see `Trust.judge`; contested: after a contest."""
        brightness = self.brightness
        verdict = self.trust.judge(views, planes, seeds, balance, brightness.confirmed(planes),
                                   brightness.light(views.left), uneven)
        if contested:
            self.steps.bound(verdict, self.contest.changed)
        return verdict

    def settle_disputes(self, views, planes, seeds):
        """
        Let seeds and the planes of neighbors take the place of planes that fit worse.

        Near depth edges a window sees two surfaces, and the brightness against the surroundings
        holds both; the search knows which one goes on. Writes d, a, b and variance of planes.

        """
        self.contest.hold(planes, self.texture.compared, self.trust.usual_balance(views, planes),
                          self.brightness.claims(views.grid))
        self.brightness.settle(planes, seeds)

    def doubt_steps(self, views, planes, seeds, balance, uneven, verdict):
        """
        Doubt ranges beside steps where the pair says little there; see `measure`.

        Blur, noise and compression mix two surfaces in a window of the least squares. Smaller
        windows tell better then which one a node belongs to. Where the pair says enough, they
        tell no more. Writes d, a, b and variance of planes; returns the Verdict.

        """
        steps, rough = self.steps, self.steps.roughness(self.quality)
        weak = steps.weakness(verdict, self.quality, rough)
        if weak > 0 and not self.brightness.seeded:
            self.contest.hold(planes, self.texture.plain(views), balance)
            balance = self.trust.usual_balance(views, planes)  # winners look elsewhere
            verdict = self.judge(views, planes, seeds, balance, uneven, contested=True)
            weak = steps.weakness(verdict, self.quality, rough)  # of what the contest has left
        steps.doubt(planes, verdict, rough, weak)
        return verdict

    def uneven(self, planes):
        """
        Measure how well planes fit; return what makes log-odds of this pair true.

        Returns
        -------
        uneven : numpy.ndarray, float32, shape (rows, columns), or None
            See `Quality.uneven`; None: an aperiodic pattern whose colors hold the planes, for
            which log-odds are fitted.

        """
        if not self.settings.matching.refinements:
            return None
        self.quality.sample(self.least_squares.linearized, planes, self.least_squares.reference)
        if self.expectation.aperiodic and not self.brightness.seeded:
            return None
        return self.quality.uneven()

    def make_std_true(self, verdict, planes, pair, alignment):
        """
        Scale standard deviations by how well planes fit and by what is unknown of the rows.

        The log-odds stay: they are fitted to variances of the assumed noise, and know the misfit.
        Writes verdict.std and planes.variance.

        Parameters
        ----------
        verdict : Verdict
            What is believed of each node.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            What the two views of the pair differ by.
        alignment : Alignment or None
            What is known of the rows; None: it is not measured.

        """
        inner = self.views.grid.inner
        assumed = planes.variance[inner].copy()
        if self.settings.matching.refinements:
            self.quality.correct_variance(planes)
        if alignment is not None:
            self.rows.widen(planes, alignment)
        weight = self.least_squares.linearized.weight if self.brightness.active else None
        rough = self.widen_slow(verdict, planes, pair, weight)
        self.trust.rescale(verdict, assumed, planes.variance)
        if rough is not None:
            self.shared.cap(verdict, rough)

    def widen_slow(self, verdict, planes, pair, weight):
        """
        Widen planes.variance by errors that windows of slow colors share.

        Returns `SharedErrors.roughness`; None where nothing is widened. Variances of averaged
        colors are fitted to that already.

        """
        averaged = self.in_force is self.slow
        if self.expectation.aperiodic or self.gray or averaged:
            return None
        rough = 0.0
        if self.brightness.seeded and self.settings.matching.refinements:
            rough = self.shared.roughness(self.quality.uneven(), verdict.log_odds)
        slow = self.shared.widen(self.views, planes, pair, weight, rough)
        return rough if slow else None

    def match_aligned(self, left, right, looks, alignment, search, clock):
        """
        Match a pair until its rows agree; see `match` and `measure` for the arguments.

        Returns
        -------
        alignment : Alignment
            As the pair shows it.
        pair : PairModel
        seeds : Seeds
            Of the last match.

        """
        last = []

        def measured(prior):
            pair, seeds = self.match(left, right, prior.applied, clock, looks)
            last[:] = [pair, seeds]
            found = self.rows.measure(self.views, self.planes, pair, prior, self.brightness)
            clock.lap('rows', found)
            return found

        return self.aligner.align(alignment, measured, search), *last

    def match(self, left, right, applied, clock, looks=None):
        """
        Match one pair: colors, coarse search and all rounds.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        applied : numpy.ndarray, float64, shape (7,)
            By which the rows of the right view are corrected, px.
        clock : Stopwatch
            Takes the durations of the stages.
        looks : sequence of two Look, optional
            As `Views.load` takes them.

        Returns
        -------
        pair : PairModel
        seeds : Seeds
            Of the last search.

        """
        views = self.views.load(left, right, applied, looks)
        self.rows.before = 0
        clock.lap('colors', views)
        self.found = self.seeds(views)
        clock.lap('coarse', self.found)
        planes, pair = self.planes.seed(self.found), PairModel.neutral(views)
        if self.settings.matching.refinements:
            pair = self.fit_seeds(views, planes, pair, clock)
        if self.evening_in_force.on and not self.gray:
            pair = self.even_out(views, planes, pair, clock)
        for turn in range(1, self.settings.matching.refinements):
            self.refine(turn, views, planes, pair, clock)
        return pair, self.found

    def curve(self, left, right, alignment, pixel):
        """
        Return the CostCurve of a pixel, None where the coarse search does not seed the pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        alignment : Alignment or None
            As the pair has shown it.
        pixel : (int, int)
            Column and row in the rectified left image.

        """
        left, right, looks = self.alike(left, right)
        applied = np.zeros(COUNT) if alignment is None else alignment.applied
        seeds = self.seeds(self.views.load(left, right, applied, looks))
        return self.coarse.curve(*pixel) if seeds is self.coarse.seeds else None

    def alike(self, left, right):
        """
        Return both raw images without color where one has none, and looks; sets `gray`.

        A mono camera beside a color camera has only brightness in common with it. looks: what
        `Views.load` takes.

        """
        looks = self.views.looker.look(left, right)
        self.gray = any(look.gray for look in looks)
        if all(look.gray == self.gray for look in looks):
            return left, right, looks
        left, right = (image if look.gray else without_color(image)
                       for image, look in zip((left, right), looks))
        return left, right, self.views.looker.look(left, right)

    def seeds(self, views):
        """Return the Seeds of a pair, and decide which carriers count in it; reads `gray`."""
        brightness = self.brightness
        brightness.rest()
        self.rival_share = 0.0
        self.suit(self.tuning)
        if self.gray:
            self.suit(self.detailed)
            seeds = self.texture.search(views, True)
            brightness.replace_colors(views)
            brightness.rely_on(seeds, views.grid)
            return seeds
        if self.expectation.aperiodic:
            if views.raised:
                return self.seeds_of_faint_colors(views)
            coarse = self.coarse.search(views)
            share = self.coarse.rival_share()
            if not self.repeats(views, share):
                return self.seeds_beside_rivals(views, coarse, share)
            if self.faint_colors_show(views):
                return self.seeds_of_faint_colors(views)
            views.common_blur = 0.0  # what repeats need not have the sharp edges of the pattern
        brightness.load(views)
        return self.detailed_seeds(views)

    def never_repeats(self, left, right, alignment):
        """
        Return whether the colors of a pair are steep and come again nowhere.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        alignment : Alignment or None
            What is known of the rows of the views.

        """
        left, right, looks = self.alike(left, right)
        if self.gray:
            return False
        applied = np.zeros(COUNT) if alignment is None else alignment.applied
        views, repetition = self.views.load(left, right, applied, looks), self.tuning.repetition
        if color_detail(views, self.tuning) < repetition.steep_detail:
            return False
        self.coarse.search(views)
        return self.coarse.rival_share() < repetition.unique_share

    def seeds_beside_rivals(self, views, coarse, share):
        """
        Return the seeds of aperiodic colors: those of the coarse search, or of one for texture.

        Where more nodes match at several places than under clear colors, the search for texture is
        asked, too: it decides by what it finds. Writes the planes. share: of the nodes with a
        rival.

        """
        if share > self.tuning.repetition.unique_share:
            found = self.texture.search(views, False)
            if self.texture.finds_more(found, self.planes.seed(coarse)):
                self.brightness.load(views)
                return self.held_by(found, views)
        if views.compressed:  # luma keeps the detail that chroma has lost
            self.brightness.load(views)
        return coarse

    def repeats(self, views, share):
        """
        Return whether the pair repeats itself where its pattern must not; sets rival_share.

        share: of the nodes with a rival.

        """
        repetition = self.tuning.repetition
        if share < repetition.noticed_share or (
                share < repetition.certain_share
                and color_detail(views, self.tuning) > repetition.least_color_detail):
            return False
        self.rival_share = share
        if self.blur_explains_rivals(views):
            self.rival_share = 0.0
        return self.rival_share > 0

    def faint_colors_show(self, views):
        """
        Return whether both views show the pattern in faint colors, which have then been raised.

        This is asked where the colors as they are seem to repeat. The tint and the noise of a
        gray pattern are faint, too. Raised, they match nowhere or at many places, and the views
        stay as they are.

        """
        kept = views.raise_faint_colors()
        if kept is None:
            return False
        self.coarse.search(views)
        if self.coarse.rival_share() < self.tuning.repetition.noticed_share:
            self.rival_share = 0.0
            return True
        views.lower_colors(kept)
        self.coarse.search(views)
        return False

    def seeds_of_faint_colors(self, views):
        """
        Return the seeds of the search for texture, and let them hold the planes.

        Raised colors are noisy, and brightness tells where they are too dim. Planes are fitted to
        the colors alone: under strong crosstalk the pattern has little contrast in brightness.

        """
        self.suit(self.detailed)
        found = self.texture.search(views, False)
        self.brightness.rely_on(found, views.grid, self.tuning.brightness.faint_seed_std)
        return found

    def detailed_seeds(self, views):
        """
        Return the seeds of the search for texture, or of the coarse search where there is none.

        Without detail at most nodes brightness does not count. Slow colors are then averaged,
        whether the pattern is known or not: noise hides how they change from node to node. Where
        there may be detail the search for texture is asked, too: it decides by what it finds.

        """
        unlike = self.tuning.unlike
        slope = median_slope(views, unlike.slope_step, unlike.slope_distance)
        slow = self.slow is self.tuning or (
            0 < slope * views.grid.columns < unlike.slowest_change)
        detailed, possible = self.detail_shown(views, slow)
        found = self.texture.search(views, False) if detailed or possible else None
        averaged = slow and not detailed
        if averaged:
            kept = views.copied()
            views.average(self.slow.views.averaging_radius, slope)
        searched = self.expectation.aperiodic and not averaged
        coarse = self.coarse.seeds if searched else self.coarse.search(views)
        if found is not None and not detailed:
            # after that, periods are judged by the search in averaged colors: one more witness
            detailed = self.texture.finds_more(found, self.planes.seed(coarse))
            if detailed and averaged:
                views.restore(kept)
        if not detailed:
            self.brightness.rest()
            if slow:
                self.suit(self.slow)
            return coarse
        return self.held_by(found, views)

    def held_by(self, found, views):
        """Let the seeds of the search for texture hold the planes; return them."""
        self.suit(self.detailed)
        self.brightness.rely_on(found, views.grid)
        if self.expectation.aperiodic or self.expectation.repeats:
            clear, odds = self.coarse.period_odds(found)
            return replace(found, clear_share=clear, period_odds=odds)
        return found

    def detail_shown(self, views, slow):
        """Return whether most nodes have detail, and whether they may; slow: not in color."""
        tuning, inner = self.tuning.brightness, views.grid.inner
        lit = views.left.variance[inner] < SILENT_VARIANCE
        level = tuple(plane[inner] for plane in self.brightness.planes[0])
        brightness = detail([level], tuning)[lit]
        colors = F4(0) if slow else detail(colors_of(views), tuning)[lit]
        # under slow colors noise stands out, too: detail that is less than it is only possible
        return (details_show(brightness, colors, tuning, quiet=not slow),
                clear_share(brightness, tuning) > tuning.possible_share)

    def suit(self, tuning):
        """Fit and judge by the constants of a Tuning from here on."""
        if tuning is not self.in_force:
            self.least_squares.suit(tuning.planes)
            self.trust.suit(tuning)
            self.rows.suit(tuning)
            self.bends.tuning, self.quality.tuning = tuning.bends, tuning.quality
            self.in_force = tuning

    def fit_seeds(self, views, planes, pair, clock):
        """
        Do the first round: fit the seeds, then measure noise and colors of the pair.

        Reads d, a, b of planes. Writes d, a, b, variance and misfit; cost stays 1.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            Equal cameras, plausible noise.
        clock : Stopwatch
            Takes the durations of the stages.

        Returns
        -------
        pair : PairModel
            As the matches of this round show it.

        """
        solver = self.least_squares
        linearized = self.linearize(views, planes, pair, planes.tiles)
        solver.fit(linearized, views, planes, pair, planes.tiles, turn=0)
        clock.lap('fit 1', planes)
        pair = self.measured_pair(views, planes, pair)
        clock.lap('compare 1', pair)
        return pair

    def even_out(self, views, planes, pair, clock):
        """
        Make the views alike in blur and color, as far as the first round shows a difference.

        Where the difference is large the search is repeated. Writes the views and all of planes.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            After the first round.
        pair : PairModel
            As the first round has measured it.
        clock : Stopwatch
            Takes the durations of the stages.

        Returns
        -------
        pair : PairModel
            That of the changed views; this one where nothing has changed.

        """
        if self.may_differ(views, planes, pair):
            pair = self.make_alike(views, planes, pair)
        clock.lap('even out', pair)
        return pair

    def may_differ(self, views, planes, pair):
        """Return whether the views may differ by more than noise, see `even_out`."""
        tuning = self.tuning
        return bool(pair.scale > tuning.unlike.quiet_scale or self.evening.matters(views)
                    or worst_part(views, planes, tuning) > tuning.unlike.quiet_part)

    def make_alike(self, views, planes, pair, search=None):
        """
        Do what `even_out` does, without asking whether a difference is likely.

        search: see `search_again`.

        """
        evening, fit = self.evening_in_force, None
        if self.brightness.active:
            if max(pair.scale, self.brightness.scale) < self.tuning.brightness.unlike_scale:
                evening = self.careful_evening
            if self.aligner is not None:  # blur hides structure
                self.rows.look(views, planes, pair, self.brightness)
        else:
            fit = evening.look(views, planes)
            if fit is None:
                if not evening.even_spread(views):
                    return pair
                pair = self.search_again(views, planes, search)
        for _ in range(self.tuning.unlike.searches + 1):
            changed, size = evening.improve(views, planes, fit)
            fit = None  # of views that have changed
            if not changed:
                break
            if size >= 1:
                before = self.in_force
                pair = self.search_again(views, planes, search)
                if self.in_force is not before and not self.evening_in_force.on:
                    break  # what the search now sees is not evened out
                continue
            pair = self.measured_anew(views, planes)
            # planes have taken a part of the difference; only detail tells which
            if self.brightness.seeded and evening.matters(views):
                pair = self.fitted_anew(views, planes)
                if evening.improve(views, planes)[0]:
                    pair = self.measured_anew(views, planes)
            break
        return pair

    def blur_explains_rivals(self, views):
        """
        Return whether colors match at several places because one view is blurred.

        Then the views have been made alike, and the coarse search has been done in them.
        Otherwise the views stay as they are.

        """
        tuning = self.tuning
        if not self.evening_in_force.on or self.rival_share > tuning.repetition.sure_share:
            return False
        kept = views.copied()
        search = self.coarse.search  # not `seeds`, which asks this
        self.make_alike(views, self.planes, self.search_again(views, self.planes, search), search)
        if views.evened > 0:
            self.coarse.search(views)
            if self.coarse.rival_share() < tuning.repetition.noticed_share:
                return True
        views.restore(kept)
        self.coarse.search(views)
        return False

    def search_again(self, views, planes, search=None):
        """
        Search and fit seeds in views that have changed; return the PairModel. Sets `found`.

        search: function of the Views that returns Seeds; default: `seeds`, since views that are
        alike may show colors that never come again.

        """
        self.found = (search or self.seeds)(views)
        planes.seed(self.found)
        return self.fitted_anew(views, planes)

    def fitted_anew(self, views, planes):
        """Fit the planes to views that have changed; return the PairModel."""
        neutral = PairModel.neutral(views)
        linearized = self.linearize(views, planes, neutral, planes.tiles)
        self.least_squares.fit(linearized, views, planes, neutral, planes.tiles, turn=0)
        return self.measured_anew(views, planes)

    def measured_anew(self, views, planes):
        """Return the PairModel of views that have changed; the planes stay."""
        neutral = PairModel.neutral(views)
        if self.brightness.active:
            self.brightness.load(views)
        return self.measured_pair(views, planes, neutral)

    def measured_pair(self, views, planes, pair):
        """
        Compare the nodes under a PairModel; return that which the matches show.

        Where a later round compares all nodes anew, the colors of the others are left alone:
        PairModel.measured reads one line of nodes in a few.

        """
        lines = (0, 1)
        if self.settings.matching.refinements > 1 and self.in_force.planes.full_rounds > 1:
            lines = sampled_lines(self.tuning.pair)
        self.linearize(views, planes, pair, planes.tiles, False, lines)
        match_colors = self.settings.matching.color_matching and self.in_force.pair.color_matching
        pair = pair.measured(views, planes, match_colors, self.tuning)
        self.brightness.measure(views)
        return pair

    def linearize(self, views, planes, pair, tiles, fold=True, lines=(0, 1)):
        """Compare the nodes of some tiles in all carriers; see `LeastSquares.linearize`."""
        solver = self.least_squares
        linearized = solver.linearize(views, planes, pair, tiles, lines)
        self.brightness.add(linearized, views, planes, tiles, solver.reference, fold)
        return linearized

    def refine(self, turn, views, planes, pair, clock):
        """
        Do a later round: planes from neighbors, least squares, wide windows where they now fit.

        Reads d, a, b of planes. Writes d, a, b, variance, misfit and, near depth edges, cost.

        Parameters
        ----------
        turn : int
            Number of the round, from 1: the seeds had round 0.
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            As the first round has measured it.
        clock : Stopwatch
            Takes the durations of the stages.

        """
        solver, edges = self.least_squares, planes.tiles
        if self.settings.matching.propagation:
            edges = rough_tiles(views, planes, solver.smooth_steps[-1])
            propagate_planes(views, planes, pair, edges, turn, self.in_force.neighbors,
                             self.brightness)
            clock.lap(f'propagate {turn}', planes)
        # colors and noise are known better after the first round: everything is fitted anew
        fitted = planes.tiles if turn < self.in_force.planes.full_rounds else edges
        linearized = self.linearize(views, planes, pair, fitted)
        narrow = solver.fit(linearized, views, planes, pair, fitted, turn)
        clock.lap(f'fit {turn + 1}', planes)
        # only tiles near depth edges: the misfit of all others, which the trust reads, and their
        # linearized nodes stay those of the planes before this fit
        linearized = self.linearize(views, planes, pair, edges)
        clock.lap(f'compare {turn + 1}', pair)
        # the misfit of polished tiles is likewise that before they are polished
        solver.polish(linearized, views, planes, pair, narrow)
        clock.lap(f'polish {turn + 1}', planes)


def identical(left, right):
    """Return whether both raw images are the same; most pairs differ in their first rows."""
    return np.array_equal(left[:8], right[:8]) and np.array_equal(left, right)
