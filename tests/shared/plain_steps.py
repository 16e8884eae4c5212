"""The scene `stack` in each engine's own API, without an adapter, and what a step of both costs."""

from time import process_time

import numpy as np

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import build
from touchstone.adapters.registry import profiles_of
from touchstone.scenarios.catalogue import catalogue

BLOCK, ROUNDS = 10, 30
"""Steps of a block, and blocks of each that take turns [1]."""
HALF, GROUND, MU = 0.05, (10.0, 10.0, 0.5), 0.5
INERTIA = HALF**2 / 1.5


def rapier():
    import rapier3d

    world = rapier3d.PhysicsWorld(gravity=(0.0, 0.0, -9.81))
    world.set_num_threads(1)
    world.integration_parameters.num_solver_iterations = 12
    ground = rapier3d.Collider.cuboid(*GROUND, friction=MU)
    world.add_body(rapier3d.RigidBody.fixed(translation=(0, 0, -0.5)), colliders=[ground])
    for k in range(5):
        cube = rapier3d.Collider.cuboid(HALF, HALF, HALF, friction=MU, mass=1.0)
        place = (0.0, 0.0, HALF * (2 * k + 1))
        world.add_body(rapier3d.RigidBody.dynamic(translation=place, can_sleep=False), colliders=[cube])
    return world.step


def physx():
    import sapien
    from sapien import physx as module

    module.set_scene_config(gravity=(0, 0, -9.81), bounce_threshold=0.2, cpu_workers=0)
    system = module.PhysxCpuSystem()
    system.timestep = 1 / 120
    scene, material = sapien.Scene([system]), module.PhysxMaterial(MU, MU, 0.0)
    for k in range(-1, 5):
        body = module.PhysxRigidStaticComponent() if k < 0 else module.PhysxRigidDynamicComponent()
        body.attach(module.PhysxCollisionShapeBox(GROUND if k < 0 else (HALF,) * 3, material))
        entity = sapien.Entity()
        entity.add_component(body)
        entity.set_pose(sapien.Pose((0, 0, -0.5 if k < 0 else HALF * (2 * k + 1))))
        scene.add_entity(entity)
        if k >= 0:
            body.mass, body.inertia = 1.0, (INERTIA,) * 3
            body.sleep_threshold = body.angular_damping = 0.0
    return lambda: (system.step(), scene)[0]


def newton():
    import newton as module
    import warp

    builder = module.ModelBuilder(gravity=(0, 0, -9.81))
    config = module.ModelBuilder.ShapeConfig(density=0.0, mu=MU, mu_torsional=0.0, mu_rolling=0.0)
    x, y, z = GROUND
    below = warp.transform((0.0, 0.0, -z), warp.quat_identity())
    builder.add_shape_box(-1, xform=below, hx=x, hy=y, hz=z, cfg=config)
    inertia = warp.mat33(np.eye(3, dtype=np.float32) * INERTIA)
    for k in range(5):
        place = warp.transform((0.0, 0.0, HALF * (2 * k + 1)), warp.quat_identity())
        body = builder.add_body(xform=place, mass=1.0, inertia=inertia, lock_inertia=True)
        builder.add_shape_box(body, hx=HALF, hy=HALF, hz=HALF, cfg=config)
    model = builder.finalize(device="cpu")
    solver, pipeline = module.solvers.SolverXPBD(model, iterations=10), module.CollisionPipeline(model)
    contacts, states, control = pipeline.contacts(), [model.state(), model.state()], model.control()
    observed = solver.observables({solver.ObservableKind.CONTACT_F}, contacts=contacts)

    def step():
        states[0].clear_forces()
        pipeline.collide(states[0], contacts)
        solver.step(*states, control, contacts, 1 / 600, observables=observed)
        states.reverse()

    return step


def mujoco():
    import mujoco as module

    model, data = _compiled()
    return lambda: module.mj_step(model, data)


def mujoco_warp():
    import mujoco_warp as module
    import warp

    model, data = _compiled()
    model.opt.disableflags = 0
    with warp.ScopedDevice("cpu"):
        given = module.put_model(model), module.put_data(model, data, nconmax=192, njmax=1920)

        def step():
            with warp.ScopedDevice("cpu"):
                module.step(*given)

    return step


def _compiled():
    """The model that the adapter of MuJoCo makes, and its data."""
    import mujoco as module

    from touchstone.adapters.engines.mujoco.engine import translated

    profile, dt = next(iter(profiles_of("mujoco").items()))
    model = translated(catalogue()["stack"], Settings(profile, dt))[0].compile()
    return model, module.MjData(model)


PLAIN = {one.__name__: one for one in (rapier, physx, newton, mujoco, mujoco_warp)}


def cost(engine, task) -> float:
    """Time of the adapter's drive and step over that of a plain step, in blocks that take turns: the least of
    each [1]."""
    profile, dt = next(iter(profiles_of(task.engine).items()))
    world = build(engine, catalogue()["stack"], Settings(profile, dt))[0]
    plain, steps = PLAIN[task.engine](), iter(range(10**9))

    def adapted():
        world.drive(next(steps) % 60)
        world.step()

    times = {adapted: [], plain: []}
    for _ in range(ROUNDS):
        for one, found in times.items():
            start = process_time()
            for _ in range(BLOCK):
                one()
            found.append(process_time() - start)
    return min(times[adapted]) / min(times[plain])
