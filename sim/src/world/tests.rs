use super::*;

const WORLD: &str = r#"
seed = 1
fleet = "fleet"
[[vehicle]]
id = "d1"
system = 11
pad = [-5.0, -7.0, 0.2]
[vehicle.params]
COM_OF_LOSS_T = 0.5
COM_OBL_RC_ACT = 5
[[vehicle]]
id = "d2"
system = 12
pad = [5.0, 7.0, 0.2]
psi = 1.0
mavlink = "127.0.0.1:0"
[[pulse]]
drone = "d2"
t = 1.0
duration = 0.5
force = [3.0, 0.0, 0.0]
[[obstacle]]
name = "wall"
faces = [
  { a = [1.0, 0.0, 0.0], b = -5.5 }, { a = [-1.0, 0.0, 0.0], b = 6.0 },
  { a = [0.0, 0.0, 1.0], b = 9.0 }, { a = [0.0, 0.0, -1.0], b = 0.0 },
  { a = [0.0, 1.0, 0.0], b = 9.0 }, { a = [0.0, -1.0, 0.0], b = 9.0 },
]
"#;

fn world() -> World {
    World::new(&WorldConfig::parse(WORLD).unwrap()).unwrap()
}

fn place(world: &mut World, i: usize, p: Vec3, v: Vec3) {
    let q = world.vehicles()[i].truth().q;
    world.vehicles_mut()[i].plant_mut().place(p, v, q);
}

#[test]
fn refuses_bad_worlds_by_field() {
    let cases = [
        ("system = 12", "system = 11", "vehicle[1].system"),
        ("id = \"d2\"", "id = \"d1\"", "vehicle[1].id"),
        ("drone = \"d2\"", "drone = \"d9\"", "pulse[0].drone"),
        ("duration = 0.5", "duration = 0.0", "pulse[0]"),
        ("127.0.0.1:0", "0.0.0.0:0", "vehicle[1].mavlink"),
        ("pad = [-5.0, -7.0, 0.2]", "pad = [-5.7, 0.0, 0.2]", "vehicle[0].pad"),
        ("COM_OBL_RC_ACT", "COM_OBL_RC_AKT", "vehicle[0].params"),
    ];
    for (old, new, field) in cases {
        let text = WORLD.replace(old, new);
        assert_ne!(text, WORLD);
        let error = WorldConfig::parse(&text).and_then(|c| World::new(&c).map(|_| ())).unwrap_err();
        assert!(error.to_string().starts_with(field), "{error}");
    }
    let error = WorldConfig::parse("seed = 1\nfleet = 3").unwrap_err();
    assert!(error.to_string().contains("fleet"), "{error}");
}

#[test]
fn a_pulse_acts_in_mission_time_on_its_drone() {
    let mut world = World::new(&WorldConfig::parse(&WORLD.replace("t = 1.0", "t = 0.1")).unwrap()).unwrap();
    place(&mut world, 0, Vec3::new(-4.0, -7.0, 50.0), Vec3::zeros());
    place(&mut world, 1, Vec3::new(5.0, 7.0, 50.0), Vec3::zeros());
    world.set_t0(Nanos(50_000_000));
    for _ in 0..150 {
        world.step();
    }
    assert_eq!(world.vehicles()[1].truth().v.x, 0.0, "not before its time");
    for _ in 150..700 {
        world.step();
    }
    // Pulse over; both fall, only d2 was pushed. Drag takes less than a tenth of the impulse.
    let expected = 3.0 * 0.5 / Airframe::F450.mass;
    let v = world.vehicles()[1].truth().v.x;
    assert!((0.9 * expected..=expected).contains(&v), "{v} {expected}");
    assert_eq!(world.vehicles()[0].truth().v.x, 0.0);
}

#[test]
fn touching_an_obstacle_is_a_crash_with_place_and_time() {
    let mut world = world();
    place(&mut world, 0, Vec3::new(-5.0, 0.0, 5.0), Vec3::new(-2.0, 0.0, 3.0));
    let crash = (0..1000).find_map(|_| world.step().pop()).unwrap();
    assert_eq!(crash.drone, "d1");
    assert!(crash.what.contains("wall"), "{}", crash.what);
    assert!((crash.p.x + 5.5).abs() < 0.01 && (crash.at.since(Nanos(0)) - 0.25).abs() < 0.05);
    assert_eq!(world.vehicles()[0].end(), End::Crashed);
    assert!((0..1000).all(|_| world.step().is_empty()), "a vehicle crashes once");
}

#[test]
fn two_vehicles_that_meet_crash_both() {
    let mut world = world();
    place(&mut world, 0, Vec3::new(0.0, 0.0, 30.0), Vec3::new(1.0, 0.0, 0.0));
    place(&mut world, 1, Vec3::new(1.0, 0.0, 30.0), Vec3::new(-1.0, 0.0, 0.0));
    for _ in 0..500 {
        world.step();
    }
    assert!(world.vehicles().iter().all(|v| v.end() == End::Crashed));
}

#[test]
fn a_fall_is_a_crash_and_rest_is_not() {
    let mut world = world();
    place(&mut world, 0, Vec3::new(-4.0, -7.0, 10.0), Vec3::zeros());
    for _ in 0..3000 {
        world.step();
    }
    assert_eq!(world.vehicles()[0].end(), End::Crashed);
    assert!(world.vehicles()[0].first_crash().unwrap().what.contains("ground"));
    assert_eq!(world.vehicles()[1].end(), End::Idle);
}
