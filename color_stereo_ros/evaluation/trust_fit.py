# SPDX-License-Identifier: Apache-2.0
"""`color_stereo trust`: fit the surface method's log-odds of being right on simulated scenes."""

SUMMARY = "fit the surface method's confidence to scenes with truth (for developers)"

SCENES = ('solids', 'prism', 'casting', 'nut', 'printed', 'thin', 'corner', 'bin', 'airplane',
          'tilt_50', 'effector_bench', 'effector_bin', 'effector_nut', 'effector_thin',
          'effector_approach', 'flat_250', 'flat_550', 'material_polished_brass',
          'material_brushed_steel')
DARKEST = 1.0   # DN of summed channels: darker nodes get no range anyway
ROUNDS = 3      # the trust decides who hides whom, and that is evidence again
FIRM = 1e-3     # per variance of a product: the form stays tame where no scene has been


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument('scenes', nargs='*', default=SCENES, metavar='SCENE',
                        help=f'names of simulated scenes (default: {" ".join(SCENES)})')
    parser.add_argument('--cache', metavar='FOLDER', default='render_output/cache',
                        help='keeps what does not depend on the pattern (default %(default)s)')


def run(args):
    """Render, fit, and print the constants for core/surface.py and what they achieve."""
    from ..core.surface import method as surface
    scenes = [simulated(name, args.cache) for name in progress(args.scenes)]
    for _ in range(ROUNDS):
        evidence = [gathered(*scene) for scene in progress(scenes)]
        weights = logistic_fit(evidence)
        surface.MODEL[:] = quadratic_form(weights[:-1])
        surface.HIDDEN_ODDS = weights[-1].astype('float32')
    print('MODEL =', quadratic_form(weights[:-1]).round(3).tolist())
    print('HIDDEN_ODDS =', round(float(weights[-1]), 3))
    for confidence in (0.5, 0.6, 0.7, 0.8, 0.9):
        print('min_confidence {:.1f}: density {:.4f}, wrong by more than 1 px {:.4f}, '
              'ranges where only the left camera sees {:.4f}'.format(
                  confidence, *operating_point(evidence, weights, confidence)))


def progress(items):
    """Return an iterable with a progress bar on standard error."""
    from tqdm import tqdm
    return tqdm(items, leave=False)


def simulated(name, cache):
    """Return (sensor, rendering) of a scene under the default pattern."""
    from ..core import ColorStereo, make_pattern, Settings
    from ..sim import load_scene
    from ..sim.renderer import Renderer
    scene = load_scene(name)
    rendering = Renderer(scene, samples=3, cache=cache).render(make_pattern(), seed=1)
    near, far = scene.rig.depth_limits
    settings = Settings().updated({'range.min_depth': near, 'range.max_depth': far})
    return ColorStereo(rendering.calibration, settings), rendering


def gathered(stereo, rendering):
    """
    Return evidence and outcome of the nodes that a surface or its absence can judge.

    Returns
    -------
    evidence : numpy.ndarray, float64, shape (N, 22)
        All products of one and the evidence of `_trust_kernels.judge`; hidden.
    right : numpy.ndarray, bool, shape (N,)
        Within 1 px of the truth, at a node that both cameras see and the projector lights.
    alone : numpy.ndarray, bool, shape (N,)
        Only the left camera sees the node.
    visible : int
        Nodes that both cameras see and the projector lights, with a disparity or without.

    """
    import numpy as np

    from ..core.surface.trust_kernels import ISLAND
    stereo.process(rendering.left_rgb, rendering.right_rgb)
    method = stereo._method
    rows, columns = method.nodes
    area = method.inner
    at_nodes = np.s_[:2 * rows:2, :2 * columns:2]
    d, a, b = (plane[area] for plane in method.planes)
    # the truth is that of the node's upper left pixel
    error = np.abs(d - 0.25 * (a + b) - rendering.truth.disparity[at_nodes])
    visible = rendering.truth.visible[at_nodes]
    alone = rendering.truth.seen_by_left_only[at_nodes]
    judged = ((visible | alone) & (method.trust[area] > ISLAND)
              & (method.left.s[area] > DARKEST)
              & (d >= method.limits[0] - 0.5) & (d <= method.limits[1] + 0.5))
    evidence = np.concatenate([products(method.evidence[:, judged].T),
                               method.hidden[area][judged][:, None]], axis=1)
    return evidence, (visible & (error <= 1))[judged], alone[judged], np.count_nonzero(visible)


def products(evidence):
    """Return all products of two of one and the evidence (N, K), (N, (K + 1) (K + 2) / 2)."""
    import numpy as np
    inputs = np.concatenate([np.ones((len(evidence), 1)), evidence], axis=1)
    return np.stack([inputs[:, i] * inputs[:, j]
                     for i, j in zip(*np.triu_indices(inputs.shape[1]))], axis=1)


def quadratic_form(weights):
    """Return the upper triangular matrix of the weights of `products`."""
    import numpy as np
    size = int((2 * len(weights)) ** 0.5)
    form = np.zeros((size, size))
    form[np.triu_indices(size)] = weights
    return form


def logistic_fit(scenes):
    """
    Return the weights, float64 (22,), of a logistic regression; each scene counts alike.

    Products of two pieces of evidence are held towards zero, see FIRM.

    """
    import numpy as np
    inputs = np.concatenate([evidence for evidence, *_ in scenes])
    right = np.concatenate([right for _, right, *_ in scenes]).astype(float)
    share = np.concatenate([np.full(len(right), 1 / len(right) / len(scenes))
                            for _, right, *_ in scenes])
    first, second = np.triu_indices(quadratic_form(np.zeros(inputs.shape[1] - 1)).shape[0])
    hold = 2e-6 + FIRM * np.append((first > 0) & (second > 0), False) * inputs.var(axis=0)
    weights = np.zeros(inputs.shape[1])
    for _ in range(30):  # Newton's method
        probability = 1 / (1 + np.exp(-np.clip(inputs @ weights, -50, 50)))
        gradient = inputs.T @ (share * (probability - right)) + hold * weights
        spread = share * probability * (1 - probability)
        curvature = inputs.T @ (inputs * spread[:, None]) + np.diag(hold)
        weights = weights - np.linalg.solve(curvature, gradient)
    return weights


def operating_point(scenes, weights, confidence):
    """Return density, share of wrong ranges, share of ranges only the left camera can see."""
    import numpy as np
    least = np.log(confidence / (1 - confidence))
    points = []
    for evidence, right, alone, visible in scenes:
        kept = evidence @ weights > least
        answered = np.count_nonzero(kept & ~alone)
        points.append((answered / visible, 1 - np.count_nonzero(kept & right) / max(answered, 1),
                       np.count_nonzero(kept & alone) / max(np.count_nonzero(kept), 1)))
    return np.mean(points, axis=0)
