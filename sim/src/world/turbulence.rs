//! Turbulence of the air: Dryden's spectra at low altitude (MIL-F-8785C, sections 3.7.1.2 and 3.7.2.1,
//! also MIL-HDBK-1797 appendix A), as filtered noise in time.

use fleet_core::types::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Period of the noise [s]: far below the shortest time that air takes past a vehicle.
pub const PERIOD: f64 = 0.01;
/// One foot [m]: the specification counts in feet.
const FOOT: f64 = 0.3048;
/// Heights between which the low-altitude form holds [ft].
const HEIGHTS: (f64, f64) = (10.0, 1000.0);
/// Slowest air past a vehicle that is reckoned with [m/s]: at rest in still air the spectra have no
/// time scale.
const SLOWEST: f64 = 1.0;

/// Intensity and length of the gusts along the mean wind, across it, and upwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Standard deviations [m/s].
    pub sigma: Vec3,
    /// Lengths [m].
    pub length: Vec3,
}

impl Scale {
    /// At `height` above the ground [m], for a mean wind of `w20` [m/s] at 20 ft.
    #[must_use]
    pub fn at(height: f64, w20: f64) -> Self {
        let h = (height / FOOT).clamp(HEIGHTS.0, HEIGHTS.1);
        let level = 0.177 + 0.000_823 * h;
        let upwards = 0.1 * w20;
        let flat = upwards / level.powf(0.4);
        let long = h / level.powf(1.2) * FOOT;
        Self { sigma: Vec3::new(flat, flat, upwards), length: Vec3::new(long, long, h * FOOT) }
    }
}

/// The air around one vehicle.
#[derive(Clone, Debug)]
pub struct Turbulence {
    rng: ChaCha8Rng,
    w20: f64,
    /// Noise through one lag, of unit variance.
    first: Vec3,
    /// The same through a second lag.
    second: Vec3,
    gust: Vec3,
}

impl Turbulence {
    /// Calm at first. `w20` is the mean wind at 20 ft [m/s] that the intensities follow from.
    #[must_use]
    pub fn new(seed: u64, w20: f64) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self { rng, w20, first: Vec3::zeros(), second: Vec3::zeros(), gust: Vec3::zeros() }
    }

    /// The gust now [m/s; ENU].
    #[must_use]
    pub fn gust(&self) -> &Vec3 {
        &self.gust
    }

    /// [`PERIOD`] later, at `height` above the ground [m], with the air moving past the vehicle at
    /// `speed` [m/s] and the mean `wind` [m/s; ENU], along which the first component lies.
    ///
    /// Along the wind the spectrum is that of one lag L/V; across and upwards it is
    /// `(1 + sqrt(3) T s) / (1 + T s)^2`, T = L/V, which is `sqrt(3) x1 + (1 - sqrt(3)) x2` of noise through
    /// one and two lags. With unit variance of x1 its variance is 2, as integrating the spectrum shows.
    pub fn advance(&mut self, height: f64, speed: f64, wind: &Vec3) {
        let scale = Scale::at(height, self.w20);
        let v = speed.max(SLOWEST);
        for axis in 0..3 {
            let noise: f64 = StandardNormal.sample(&mut self.rng);
            let keep = (-PERIOD * v / scale.length[axis]).exp();
            self.first[axis] = keep * self.first[axis] + (1.0 - keep * keep).sqrt() * noise;
            self.second[axis] += (1.0 - keep) * (self.first[axis] - self.second[axis]);
        }
        let root = 3.0_f64.sqrt();
        let two = |axis: usize| {
            let lagged = root * self.first[axis] + (1.0 - root) * self.second[axis];
            scale.sigma[axis] * std::f64::consts::FRAC_1_SQRT_2 * lagged
        };
        let (along, across, up) = (scale.sigma.x * self.first.x, two(1), two(2));
        let flat = wind.xy().norm();
        let (east, north) = if flat > 0.0 { (wind.x / flat, wind.y / flat) } else { (1.0, 0.0) };
        self.gust = Vec3::new(along * east - across * north, along * north + across * east, up);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gusts over `seconds` at 20 m height, 8 m/s of air, wind towards `wind`.
    fn record(seed: u64, seconds: f64, wind: Vec3) -> Vec<Vec3> {
        let mut air = Turbulence::new(seed, 10.0);
        (0..(seconds / PERIOD) as usize)
            .map(|_| {
                air.advance(20.0, 8.0, &wind);
                *air.gust()
            })
            .collect()
    }

    #[test]
    fn scales_are_those_of_the_specification() {
        // At 1000 ft the low-altitude forms meet those of medium height: L = 1000 ft in all axes and
        // equal intensities.
        let top = Scale::at(1000.0 * FOOT, 10.0);
        for axis in 0..3 {
            assert!((top.length[axis] - 1000.0 * FOOT).abs() < 1e-6);
            assert!((top.sigma[axis] - 1.0).abs() < 1e-9);
        }
        let low = Scale::at(6.096, 10.0);
        assert!((low.sigma.z - 1.0).abs() < 1e-12 && (low.length.z - 6.096).abs() < 1e-9);
        assert!((low.sigma.x - 1.0 / (0.177_f64 + 0.000_823 * 20.0).powf(0.4)).abs() < 1e-12);
        assert!((low.length.x - 6.096 / (0.177_f64 + 0.000_823 * 20.0).powf(1.2)).abs() < 1e-9);
    }

    #[test]
    fn gusts_have_the_variance_and_the_correlation_of_the_spectra() {
        let gusts = record(7, 40_000.0, Vec3::new(8.0, 0.0, 0.0));
        let scale = Scale::at(20.0, 10.0);
        let n = gusts.len() as f64;
        for axis in 0..3 {
            let mean = gusts.iter().map(|g| g[axis]).sum::<f64>() / n;
            let sigma = (gusts.iter().map(|g| (g[axis] - mean).powi(2)).sum::<f64>() / n).sqrt();
            assert!((sigma / scale.sigma[axis] - 1.0).abs() < 0.05, "axis {axis}: {sigma}");
            assert!(mean.abs() < 0.1 * sigma, "axis {axis}: mean {mean}");
            // Correlation over one lag T: e^-1 of one lag; e^-1 / 2 of the transverse spectrum,
            // whose correlation is e^(-t/T) (1 - t / 2T).
            let lag = (scale.length[axis] / 8.0 / PERIOD).round() as usize;
            let pairs = gusts.iter().zip(&gusts[lag..]);
            let product = pairs.map(|(a, b)| a[axis] * b[axis]).sum::<f64>() / (n - lag as f64);
            let expected = (-1.0_f64).exp() * if axis == 0 { 1.0 } else { 0.5 };
            assert!((product / sigma.powi(2) - expected).abs() < 0.06, "axis {axis}");
        }
    }

    #[test]
    fn the_first_component_lies_along_the_wind() {
        let (east, north) = (Vec3::new(5.0, 0.0, 0.0), Vec3::new(0.0, 5.0, 0.0));
        for (a, b) in record(3, 5.0, east).iter().zip(&record(3, 5.0, north)) {
            assert!((a.x - b.y).abs() < 1e-12 && (a.y + b.x).abs() < 1e-12 && (a.z - b.z).abs() < 1e-12);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_air() {
        let wind = Vec3::new(3.0, 4.0, 0.0);
        assert_eq!(record(5, 2.0, wind), record(5, 2.0, wind));
        assert_ne!(record(5, 2.0, wind), record(6, 2.0, wind));
    }
}
