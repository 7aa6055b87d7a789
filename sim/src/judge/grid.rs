//! The grid that comes nearest to a series of moments.

/// `t = origin + period * n`, fitted by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Where the line crosses n = 0.
    pub origin: f64,
    /// Its slope.
    pub period: f64,
}

impl Grid {
    /// Fits a grid to points (n, t). `None` with fewer than two different n.
    pub fn fit(points: &[(u64, f64)]) -> Option<Grid> {
        let count = points.len() as f64;
        if points.is_empty() {
            return None;
        }
        // Centred sums: a run's moments are large against their deviations.
        let mean_n = points.iter().map(|&(n, _)| n as f64).sum::<f64>() / count;
        let mean_t = points.iter().map(|&(_, t)| t).sum::<f64>() / count;
        let mut nn = 0.0;
        let mut nt = 0.0;
        for &(n, t) in points {
            let dn = n as f64 - mean_n;
            nn += dn * dn;
            nt += dn * (t - mean_t);
        }
        if nn == 0.0 {
            return None;
        }
        let period = nt / nn;
        Some(Grid {
            origin: mean_t - period * mean_n,
            period,
        })
    }

    /// How much later than the grid each point is.
    pub fn residuals(&self, points: &[(u64, f64)]) -> Vec<f64> {
        points
            .iter()
            .map(|&(n, t)| t - (self.origin + self.period * n as f64))
            .collect()
    }
}

/// Largest minus smallest; 0 of nothing.
pub fn peak_to_peak(values: &[f64]) -> f64 {
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
            (low.min(v), high.max(v))
        });
    if high >= low { high - low } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_grid_has_no_residuals() {
        let points: Vec<_> = (0..1000).map(|n| (n, 5.0 + 10_000.25 * n as f64)).collect();
        let grid = Grid::fit(&points).unwrap();
        assert!((grid.period - 10_000.25).abs() < 1e-9);
        assert!(peak_to_peak(&grid.residuals(&points)) < 1e-6);
    }

    #[test]
    fn holes_do_not_bend_it() {
        let points: Vec<_> = (0..100)
            .filter(|n| n % 7 != 3)
            .map(|n| (n, 3.0 * n as f64))
            .collect();
        let grid = Grid::fit(&points).unwrap();
        assert!((grid.period - 3.0).abs() < 1e-12 && grid.origin.abs() < 1e-9);
    }

    #[test]
    fn one_late_point_among_many_shows_almost_whole() {
        let mut points: Vec<_> = (0..1001).map(|n| (n, 10_000.0 * n as f64)).collect();
        points[500].1 += 100.0;
        let residuals = Grid::fit(&points).unwrap().residuals(&points);
        let jitter = peak_to_peak(&residuals);
        assert!((jitter - 100.0).abs() < 0.2, "{jitter}");
    }

    #[test]
    fn too_little_gives_no_grid() {
        assert_eq!(Grid::fit(&[]), None);
        assert_eq!(Grid::fit(&[(4, 1.0)]), None);
        assert_eq!(peak_to_peak(&[]), 0.0);
    }
}
