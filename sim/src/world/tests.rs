use super::*;
use fleet_core::types::Vec3;

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
        ("[[pulse]]", "[[gust]]\nt = 0.0\nduration = -1.0\nvelocity = [1.0, 0.0, 0.0]\n[[pulse]]", "gust[0]"),
        ("[[vehicle]]\nid = \"d1\"", "[wind]\nturbulence = -1.0\n[[vehicle]]\nid = \"d1\"", "wind"),
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
fn a_gust_swells_and_fades_over_all_vehicles() {
    let gust = "[[gust]]\nt = 1.0\nduration = 2.0\nvelocity = [0.0, 6.0, 0.0]\n";
    let world = World::new(&WorldConfig::parse(&format!("{WORLD}{gust}")).unwrap()).unwrap();
    let mut environment = Environment::new(&WorldConfig::parse(&format!("{WORLD}{gust}")).unwrap());
    assert_eq!(world.vehicles().len(), 2);
    assert_eq!(environment.wind(Nanos(2_000_000_000)), Vec3::zeros(), "no start is known");
    environment.set_t0(Nanos(0));
    for (t, north) in [(0.9, 0.0), (1.0, 0.0), (1.5, 3.0), (2.0, 6.0), (2.5, 3.0), (3.0, 0.0), (3.1, 0.0)] {
        let wind = environment.wind(Nanos((t * 1e9) as u64));
        assert!((wind - Vec3::new(0.0, north, 0.0)).norm() < 1e-6, "{t}: {wind}");
    }
}

#[test]
fn turbulence_differs_from_vehicle_to_vehicle_and_comes_from_the_seed() {
    let fly = |seed: &str| {
        let wind = "[wind]\nvelocity = [6.0, 0.0, 0.0]\nturbulence = 8.0\n";
        let text = WORLD
            .replace("seed = 1", seed)
            .replace("[[vehicle]]\nid = \"d1\"", &format!("{wind}[[vehicle]]\nid = \"d1\""));
        let mut world = World::new(&WorldConfig::parse(&text).unwrap()).unwrap();
        for i in 0..2 {
            place(&mut world, i, Vec3::new(0.0, 20.0 * i as f64, 80.0), Vec3::zeros());
        }
        for _ in 0..2000 {
            world.step();
        }
        [world.vehicles()[0].truth().v, world.vehicles()[1].truth().v]
    };
    let [one, two] = fly("seed = 1");
    assert!(one.x > 0.1 && two.x > 0.1, "the wind takes both along");
    assert!((one - two).norm() > 1e-3);
    assert_eq!([one, two], fly("seed = 1"));
    assert_ne!([one, two], fly("seed = 2"));
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
