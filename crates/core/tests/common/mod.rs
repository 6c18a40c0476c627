//! Random formulas, traces and trajectories for the property tests.
#![allow(dead_code, missing_docs, clippy::unwrap_used)] // helpers of tests; each binary uses a part

pub mod messages;

use fleet_core::formula::{Axis, Comparison, Formula, Names, Term};
use fleet_core::geometry::Polyhedron;
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::Vec3;
use fleet_core::wire::Region;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Sample period of every test [s].
pub const SAMPLE: f64 = 0.1;
/// No formula of [`formula`] looks farther ahead than this many samples.
pub const HORIZON: usize = 40;

/// So many cases, the same in every run.
pub fn seeded(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() }
}

pub fn vec3(range: f64) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-range..range).prop_map(Vec3::from)
}

pub fn drone() -> impl Strategy<Value = String> {
    prop_oneof![Just("d1".to_owned()), Just("d2".to_owned())]
}

fn region_name() -> impl Strategy<Value = String> {
    prop_oneof![Just("box".to_owned()), Just("wedge".to_owned())]
}

/// Two drones and the regions.
pub fn names() -> Names {
    Names::new(vec!["d1".to_owned(), "d2".to_owned()], regions()).unwrap()
}

/// A box and a tetrahedron.
pub fn regions() -> Vec<Region> {
    let a = Polyhedron::from_box(Vec3::new(-1.0, -2.0, -1.5), Vec3::new(2.0, 1.0, 0.5)).unwrap();
    let row = |x: f64, y: f64, z: f64, b: f64| fleet_core::geometry::HalfSpace { a: Vec3::new(x, y, z), b };
    let b = Polyhedron::try_from(vec![
        row(1.0, 1.0, 1.0, 2.0),
        row(-1.0, 0.0, 0.0, 1.0),
        row(0.0, -1.0, 0.0, 1.0),
        row(0.0, 0.0, -1.0, 1.0),
    ])
    .unwrap();
    [("box", a), ("wedge", b)]
        .into_iter()
        .map(|(name, shape)| Region { name: name.to_owned(), shape })
        .collect()
}

pub fn predicate() -> impl Strategy<Value = Formula> {
    let cmp = prop_oneof![Just(Comparison::Ge), Just(Comparison::Le)];
    let axis = prop_oneof![Just(Axis::X), Just(Axis::Y), Just(Axis::Z)];
    let term = (drone(), axis, -2.0..2.0).prop_map(|(drone, axis, coef)| Term { drone, axis, coef });
    prop_oneof![
        (drone(), region_name()).prop_map(|(drone, region)| Formula::In { drone, region }),
        (drone(), region_name()).prop_map(|(drone, region)| Formula::Outside { drone, region }),
        (cmp, 0.5..4.0).prop_map(|(cmp, value)| Formula::Dist {
            a: "d1".to_owned(),
            b: "d2".to_owned(),
            cmp,
            value
        }),
        (prop::collection::vec(term, 1..3), -2.0..2.0)
            .prop_map(|(terms, constant)| Formula::Linear { terms, constant }),
    ]
}

/// A window in samples, as seconds.
pub fn window() -> impl Strategy<Value = (f64, f64)> {
    (0_u32..6, 0_u32..8).prop_map(|(from, width)| {
        let seconds = |k: u32| f64::from(k) * SAMPLE;
        (seconds(from), seconds(from + width))
    })
}

/// Random formulas of the whole language, at most three operators deep.
pub fn formula() -> impl Strategy<Value = Formula> {
    predicate().prop_recursive(3, 12, 3, |inner| prop_oneof![2 => ahead(&inner), 1 => back(&inner)])
}

/// Random formulas without past operators: their robustness at a sample depends on that and later ones alone.
pub fn future_formula() -> impl Strategy<Value = Formula> {
    predicate().prop_recursive(3, 12, 3, |inner| ahead(&inner).boxed())
}

fn back(inner: &BoxedStrategy<Formula>) -> impl Strategy<Value = Formula> + use<> {
    let boxed = || inner.clone().prop_map(Box::new);
    prop_oneof![
        (window(), boxed()).prop_map(|((from, to), f)| Formula::Once { from, to, f }),
        (window(), boxed()).prop_map(|((from, to), f)| Formula::Historically { from, to, f }),
        (window(), boxed(), boxed()).prop_map(|((from, to), left, right)| Formula::Since {
            from,
            to,
            left,
            right
        }),
    ]
}

fn ahead(inner: &BoxedStrategy<Formula>) -> impl Strategy<Value = Formula> + use<> {
    let boxed = || inner.clone().prop_map(Box::new);
    prop_oneof![
        boxed().prop_map(|f| Formula::Not { f }),
        prop::collection::vec(inner.clone(), 1..4).prop_map(|fs| Formula::And { fs }),
        prop::collection::vec(inner.clone(), 1..4).prop_map(|fs| Formula::Or { fs }),
        (boxed(), boxed()).prop_map(|(left, right)| Formula::Implies { left, right }),
        (window(), boxed()).prop_map(|((from, to), f)| Formula::Always { from, to, f }),
        (window(), boxed()).prop_map(|((from, to), f)| Formula::Eventually { from, to, f }),
        (window(), boxed(), boxed()).prop_map(|((from, to), left, right)| Formula::Until {
            from,
            to,
            left,
            right
        }),
    ]
}

/// Random walks, one for each of two drones.
pub fn tracks() -> impl Strategy<Value = Vec<Vec<Vec3>>> {
    let track = prop::collection::vec(vec3(4.0), HORIZON + 5);
    prop::collection::vec(track, 2)
}

/// A trajectory from 0 to at least the horizon whose knots do not lie on the samples.
pub fn trajectory() -> impl Strategy<Value = Trajectory> {
    let knot = (0.3..1.0, vec3(4.0), vec3(2.0), vec3(2.0));
    prop::collection::vec(knot, 16).prop_map(|knots| {
        let mut t = 0.0;
        let knots: Vec<Knot> = knots
            .into_iter()
            .map(|(h, p, v, a)| {
                let knot = Knot { t, p, v, a, psi: 0.0, psi_rate: 0.0, psi_acc: 0.0 };
                t += h;
                knot
            })
            .collect();
        Trajectory::try_from(knots).unwrap()
    })
}

/// Positions at `count` multiples of `sample` [s].
pub fn sampled(trajectory: &Trajectory, sample: f64, count: usize) -> Vec<Vec3> {
    (0..count).map(|k| trajectory.position(k as f64 * sample)).collect()
}
