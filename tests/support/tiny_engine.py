"""A tiny engine in JavaScript, and its package: what the bridge to Node.js is tested with."""

from dropspin.comparisons.engines.node_engine import NodeEngine

PACKAGE = "@tiny/engine"


class TinyEngine(NodeEngine):
    """A body that falls without turning."""

    name, package, order = "tiny", PACKAGE, 1.0

    def declines(self, scene):
        return "bodies that do not turn, without a floor" if scene.floor or scene.damping or any(scene.start.angular_velocity) else None

    def world_settings(self, scene, dt):
        return {"lowest": -1e6}


def install(folder):
    """Put the package into a folder, as npm does."""
    package = folder / "node_modules" / PACKAGE
    package.mkdir(parents=True)
    (package / "package.json").write_text('{"version": "1.2.3", "type": "module", "main": "no.cjs", "module": "main.js"}')
    (package / "main.js").write_text("export const add = (a, b) => a + b;")
