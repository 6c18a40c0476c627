//! Laws of robustness: duality, monotony, shift, and the bound below every sampling.
#![allow(missing_docs, clippy::unwrap_used)] // clippy.toml spares only functions marked as tests

mod common;

use common::{
    HORIZON, SAMPLE, formula, future_formula, names, predicate, sampled, tracks, trajectory, vec3, window,
};
use fleet_core::formula::{Compiled, Formula, FormulaError, bound, compile, exact};
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::Vec3;
use proptest::prelude::*;

fn compiled(formula: &Formula) -> Compiled {
    compile(formula, &names(), SAMPLE).unwrap()
}

fn rho(formula: &Formula, tracks: &[Vec<Vec3>]) -> f64 {
    exact::evaluate(&compiled(formula), tracks).unwrap().rho
}

fn boxed(f: &Formula) -> Box<Formula> {
    Box::new(f.clone())
}

proptest! {
    #![proptest_config(common::seeded(512))]

    #[test]
    fn negation_changes_the_sign(f in formula(), tracks in tracks()) {
        let not = Formula::Not { f: boxed(&f) };
        prop_assert_eq!(rho(&not, &tracks), -rho(&f, &tracks));
    }

    #[test]
    fn double_negation_compiles_to_the_same(f in formula()) {
        let not = Formula::Not { f: boxed(&f) };
        let twice = Formula::Not { f: Box::new(not) };
        prop_assert_eq!(compiled(&twice), compiled(&f));
    }

    #[test]
    fn a_wider_window_lowers_always_and_raises_eventually(
        f in predicate(), (from, to) in window(), tracks in tracks()
    ) {
        let wider = to + SAMPLE;
        let always = |to| Formula::Always { from, to, f: boxed(&f) };
        let eventually = |to| Formula::Eventually { from, to, f: boxed(&f) };
        prop_assert!(rho(&always(wider), &tracks) <= rho(&always(to), &tracks));
        prop_assert!(rho(&eventually(wider), &tracks) >= rho(&eventually(to), &tracks));
    }

    #[test]
    fn until_with_a_true_left_side_is_eventually(f in predicate(), (from, to) in window(), tracks in tracks()) {
        // d1.x >= -1000 holds by far.
        let always_true = Formula::Linear { terms: vec![fleet_core::formula::Term {
            drone: "d1".to_owned(), axis: fleet_core::formula::Axis::X, coef: 1.0 }], constant: 1000.0 };
        let until = Formula::Until { from, to, left: Box::new(always_true), right: boxed(&f) };
        let eventually = Formula::Eventually { from, to, f: boxed(&f) };
        prop_assert_eq!(rho(&until, &tracks), rho(&eventually, &tracks));
    }

    #[test]
    fn the_trace_at_k_is_the_value_of_the_trace_cut_at_k(f in future_formula(), tracks in tracks()) {
        let f = compiled(&f);
        let trace = exact::robustness(&f, &tracks).unwrap();
        prop_assert_eq!(trace.len(), tracks[0].len() - f.root.horizon());
        for (k, point) in trace.iter().enumerate() {
            let cut: Vec<&[Vec3]> = tracks.iter().map(|t| &t[k..]).collect();
            let alone = exact::evaluate(&f, &cut).unwrap();
            prop_assert_eq!(alone.rho, point.rho);
            prop_assert_eq!(alone.at + k, point.at);
        }
    }

    #[test]
    fn the_value_is_attained_at_the_tightest_sample(f in formula(), tracks in tracks()) {
        // Some predicate of the normal form has this very value there; `release` negates twice.
        let f = compiled(&f);
        let point = exact::evaluate(&f, &tracks).unwrap();
        // Windows before mission time 0 alone give a value that no predicate has.
        prop_assume!(point.rho.is_finite());
        prop_assert!(point.at <= f.root.horizon());
        let mut values = Vec::new();
        leaves(&f.root, &mut values, &|p| p.value(|d| tracks[d][point.at]));
        prop_assert!(values.contains(&point.rho));
    }
}

fn leaves(
    node: &fleet_core::formula::Node,
    out: &mut Vec<f64>,
    value: &impl Fn(&fleet_core::formula::Predicate) -> f64,
) {
    use fleet_core::formula::Node;
    match node {
        Node::Predicate(p) => out.push(value(p)),
        Node::And(fs) | Node::Or(fs) => fs.iter().for_each(|f| leaves(f, out, value)),
        Node::Always(_, f) | Node::Eventually(_, f) | Node::Once(_, f) | Node::Historically(_, f) => {
            leaves(f, out, value);
        }
        Node::Until { left, right, .. }
        | Node::Release { left, right, .. }
        | Node::Since { left, right, .. }
        | Node::Trigger { left, right, .. } => {
            leaves(left, out, value);
            leaves(right, out, value);
        }
    }
}

proptest! {
    #![proptest_config(common::seeded(256))]

    #[test]
    fn the_bound_is_below_every_refinement_of_the_samples(f in formula(), a in trajectory(), b in trajectory()) {
        below_every_refinement(&f, &[&a, &b])?;
    }

    #[test]
    fn the_bound_of_always_over_regions_and_pairs_is_tight(
        f in predicate(), (from, to) in window(), a in trajectory(), b in trajectory()
    ) {
        let always = Formula::Always { from, to, f: Box::new(f) };
        let bound = bound::lower_bound(&compiled(&always), &[&a, &b]).unwrap();
        let sample = SAMPLE / 200.0;
        let fine = compile(&always, &names(), sample).unwrap();
        let count = fine.root.horizon() + 1;
        let tracks = [sampled(&a, sample, count), sampled(&b, sample, count)];
        let exact = exact::evaluate(&fine, &tracks).unwrap();
        // These curves reach 30 m/s, so that 0.5 ms of sampling costs up to 15 mm on its own.
        prop_assert!(bound.rho >= exact.rho - 0.02, "bound {} far below {}", bound.rho, exact.rho);
    }

    /// Nothing happens between samples there, so that all slack would be the operators' own.
    #[test]
    fn the_bound_of_hovering_is_the_value(f in formula(), p in vec3(4.0), q in vec3(4.0)) {
        let (a, b) = (hovering(p), hovering(q));
        let bound = bound::lower_bound(&compiled(&f), &[&a, &b]).unwrap();
        let count = compiled(&f).root.horizon() + 1;
        let value = rho(&f, &[sampled(&a, SAMPLE, count), sampled(&b, SAMPLE, count)]);
        prop_assert!(value == bound.rho || (value - bound.rho - bound::ROUNDING).abs() < 1e-6);
    }

    #[test]
    fn at_a_single_moment_the_bound_is_the_value(f in predicate(), a in trajectory(), b in trajectory()) {
        let bound = bound::lower_bound(&compiled(&f), &[&a, &b]).unwrap();
        let value = rho(&f, &[sampled(&a, SAMPLE, 1), sampled(&b, SAMPLE, 1)]);
        prop_assert!((value - bound.rho - bound::ROUNDING).abs() < 1e-12);
    }
}

proptest! {
    #![proptest_config(common::seeded(4096))]

    /// Until and its dual, bare and over an interval: rare in random formulas, and the hardest to bound.
    #[test]
    fn the_bound_of_until_is_below_every_refinement_of_the_samples(
        left in predicate(), right in predicate(), inner in window(), outer in window(), negated in any::<bool>(),
        a in trajectory(), b in trajectory(),
    ) {
        let until = |left: &Formula| Formula::Until {
            from: inner.0, to: inner.1, left: boxed(left), right: boxed(&right)
        };
        let sign = |f| if negated { Formula::Not { f: Box::new(f) } } else { f };
        let held = sign(until(&left));
        below_every_refinement(&held, &[&a, &b])?;
        let always = Formula::Always { from: outer.0, to: outer.1, f: Box::new(held) };
        below_every_refinement(&always, &[&a, &b])?;
    }
}

proptest! {
    #![proptest_config(common::seeded(4096))]

    /// Past operators around every corner: cut at 0, over an interval, negated, deciding or not.
    #[test]
    fn the_bound_of_past_operators_is_below_every_refinement_of_the_samples(
        left in predicate(), right in predicate(), back in window(), ahead in window(), kind in 0_u8..3,
        negated in any::<bool>(), all in any::<bool>(), a in trajectory(), b in trajectory(),
    ) {
        let (from, to) = back;
        let past = match kind {
            0 => Formula::Once { from, to, f: boxed(&right) },
            1 => Formula::Historically { from, to, f: boxed(&right) },
            _ => Formula::Since { from, to, left: boxed(&left), right: boxed(&right) },
        };
        let past = if negated { Formula::Not { f: Box::new(past) } } else { past };
        let (from, to, f) = (ahead.0, ahead.1, Box::new(past));
        let whole = if all { Formula::Always { from, to, f } } else { Formula::Eventually { from, to, f } };
        below_every_refinement(&whole, &[&a, &b])?;
    }

    /// With nothing cut off, looking back from the end is looking ahead.
    #[test]
    fn the_past_seen_from_the_end_is_the_future_seen_from_the_start(
        left in predicate(), right in predicate(), (from, to) in window(), kind in 0_u8..3, tracks in tracks()
    ) {
        let (now, back) = match kind {
            0 => (Formula::Eventually { from, to, f: boxed(&right) }, Formula::Once { from, to, f: boxed(&right) }),
            1 => (Formula::Always { from, to, f: boxed(&right) }, Formula::Historically { from, to, f: boxed(&right) }),
            _ => (
                Formula::Until { from, to, left: boxed(&left), right: boxed(&right) },
                Formula::Since { from, to, left: boxed(&left), right: boxed(&right) },
            ),
        };
        let turned: Vec<Vec<Vec3>> = tracks.iter().map(|t| t.iter().rev().copied().collect()).collect();
        let ahead = exact::robustness(&compiled(&now), &tracks).unwrap();
        let behind = exact::robustness(&compiled(&back), &turned).unwrap();
        let last = tracks[0].len() - 1;
        prop_assert_eq!(behind.len(), last + 1);
        for (k, point) in ahead.iter().enumerate() {
            prop_assert_eq!(point.rho, behind[last - k].rho);
        }
    }
}

#[test]
fn the_past_begins_at_mission_time_0() {
    let inside = Formula::In { drone: "d1".to_owned(), region: "box".to_owned() };
    let (from, to) = (0.2, 0.4);
    let track = vec![vec![Vec3::zeros(); 8]; 2];
    let here = rho(&inside, &track);
    let rhos = |f: Formula| -> Vec<f64> {
        exact::robustness(&compiled(&f), &track).unwrap().iter().map(|p| p.rho).collect()
    };
    let never = f64::NEG_INFINITY;
    let f = || boxed(&inside);
    assert_eq!(rhos(Formula::Once { from, to, f: f() })[..3], [never, never, here]);
    assert_eq!(rhos(Formula::Historically { from, to, f: f() })[..3], [-never, -never, here]);
    assert_eq!(rhos(Formula::Since { from, to, left: f(), right: f() })[..3], [never, never, here]);
    // What lies 0.2 s back is known 0.2 s longer.
    let late = Formula::Once { from, to, f: Box::new(Formula::Always { from: 0.0, to: 0.3, f: f() }) };
    assert_eq!(compiled(&late).root.horizon(), 1);
    assert_eq!(rhos(late).len(), 7);
}

fn hovering(p: Vec3) -> Trajectory {
    let still = Vec3::zeros();
    let knot = |t| Knot { t, p, v: still, a: still, psi: 0.0, psi_rate: 0.0, psi_acc: 0.0 };
    Trajectory::try_from(vec![knot(0.0), knot(5.0)]).unwrap()
}

/// The exact value at the samples themselves and at finer ones may not be below the bound.
fn below_every_refinement(f: &Formula, trajectories: &[&Trajectory; 2]) -> Result<(), TestCaseError> {
    let bound = bound::lower_bound(&compiled(f), trajectories).unwrap();
    for refinement in [1, 7] {
        let sample = SAMPLE / f64::from(refinement);
        let fine = compile(f, &names(), sample).unwrap();
        let count = fine.root.horizon() + 1;
        let tracks = trajectories.map(|t| sampled(t, sample, count));
        let exact = exact::evaluate(&fine, &tracks).unwrap();
        prop_assert!(
            bound.rho <= exact.rho,
            "bound {} above exact {} at 1/{}",
            bound.rho,
            exact.rho,
            refinement
        );
    }
    Ok(())
}

#[test]
fn what_is_not_legal_is_refused_with_its_name() {
    let inside =
        |drone: &str, region: &str| Formula::In { drone: drone.to_owned(), region: region.to_owned() };
    let always = |from, to| Formula::Always { from, to, f: Box::new(inside("d1", "box")) };
    let error = |f: &Formula| compile(f, &names(), SAMPLE).unwrap_err().to_string();
    assert_eq!(error(&inside("d3", "box")), "unknown drone `d3`; the fleet has d1, d2");
    assert_eq!(error(&inside("d1", "bax")), "unknown region `bax`; there are box, wedge");
    for (from, to) in
        [(0.05, 1.0), (1.0, 0.5), (-0.1, 1.0), (0.0, f64::INFINITY), (f64::NAN, 1.0), (0.0, 1e12)]
    {
        assert!(matches!(compile(&always(from, to), &names(), SAMPLE), Err(FormulaError::Window { .. })));
    }
    assert_eq!(error(&Formula::And { fs: Vec::new() }), "`and` needs at least one operand");
    let dist = Formula::Dist {
        a: "d1".to_owned(),
        b: "d2".to_owned(),
        cmp: fleet_core::formula::Comparison::Ge,
        value: f64::NAN,
    };
    assert_eq!(error(&dist), "the threshold of dist is not a finite number");
    for sample in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(compile(&always(0.0, 1.0), &names(), sample), Err(FormulaError::Sample(_))));
    }
}

#[test]
fn a_trace_that_ends_before_the_horizon_is_refused() {
    let inside = Formula::In { drone: "d1".to_owned(), region: "box".to_owned() };
    let f = compiled(&Formula::Eventually { from: 0.0, to: 1.0, f: Box::new(inside) });
    let track = |n: usize| vec![vec![Vec3::zeros(); n]; 2];
    assert!(exact::evaluate(&f, &track(11)).is_ok());
    let short = exact::evaluate(&f, &track(10)).unwrap_err();
    assert_eq!(short.to_string(), "the formula looks 1 s ahead, beyond the end at 0.9 s");
    assert!(exact::evaluate(&f, &track(0)).is_err());
    assert!(exact::evaluate(&f, &track(11)[..1]).is_err());
    let mut hole = track(HORIZON);
    hole[1][3].y = f64::NAN;
    assert_eq!(exact::evaluate(&f, &hole).unwrap_err(), FormulaError::NotFinite("a position".to_owned()));
}
