"""The name of each catalogue scene's exact solution, for the list of scenes.

`truth_for` returns solutions with the same names, and a test compares them. It also computes the impacts, which takes half a second and
imports SciPy, so the list of scenes does not use it.
"""

_SCENES = {
    "ball-impact": ("drop-ball-slipping", "drop-ball-backspin", "drop-ball-grip"),
    "bounce-ladder": (
        "bounce-95",
        "bounce-99",
        "bounce-9999",
        "bounce-elastic",
        "bounce-threshold",
        "drop-ball",
        "drop-ball-brisk",
        "drop-ball-dull",
        "drop-ball-lively",
        "drop-box-flat",
        "turn-box-flat",
    ),
    "corner-impact": (
        "drop-box-anyhow",
        "drop-box-corner",
        "drop-box-heavy",
        "drop-box-sticking",
        "drop-box-tumble",
        "drop-box-turning",
        "drop-box-slippery",
        "drop-tetra-turning",
    ),
    "coulomb-slide": ("slide-box", "slide-box-askew", "slope-box-hold", "slope-box-slide"),
    "coulomb-turn": ("turn-box-rough",),
    "damped-free-rotor": ("spin-damped",),
    "damped-parabola": ("fall-damped",),
    "edge-impact": ("drop-box-edge",),
    "free-rotor": ("fall-tilted", "spin-asymmetric", "spin-coin", "spin-dzhanibekov", "spin-needle"),
    "principal-spin": ("fall-spin", "spin-principal", "spin-principal-50", "spin-principal-500"),
    "rimless-wheel": ("roll-prism", "roll-prism-slope"),
    "rocking": ("rest-long", "rock-block"),
    "rolling": ("roll-ball", "roll-ball-back", "roll-ball-side", "roll-slope"),
    "slipping": ("slip-stick",),
    "top": ("top-nutating", "top-steady"),
    "tipping": ("tip-box",),
}
CATALOGUE_TRUTHS = {scene: truth for truth, scenes in _SCENES.items() for scene in scenes}
"""Names of exact solutions by name of the scene; a scene without an exact solution is absent."""
