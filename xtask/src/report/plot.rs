//! Figures over a number, as a picture of its own.

use anyhow::Result;
use plotters::prelude::*;

use super::charts::{COLOURS, drawing, legend, style, svg, swatch};

/// One curve.
pub(crate) struct Curve {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
}

const HEIGHT: u32 = 420;
/// Air around the curves.
const AIR: f64 = 1.08;

/// Curves with their points marked, from zero on.
pub(crate) fn lines(x: &str, y: &str, curves: &[Curve]) -> Result<String> {
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let right = all().map(|(x, _)| *x).fold(1.0, f64::max);
    let top = all().map(|(_, y)| *y).fold(1.0, f64::max) * AIR;
    svg(HEIGHT, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .margin_right(24)
            .x_label_area_size(42)
            .y_label_area_size(72)
            .build_cartesian_2d(0.0..right + 1.0, 0.0..top)
            .map_err(drawing)?;
        style(chart.configure_mesh())
            .x_desc(x)
            .y_desc(y)
            .x_labels(right as usize + 2)
            .x_label_formatter(&|value| format!("{value:.0}"))
            .y_label_formatter(&|value| format!("{value:.0}"))
            .draw()
            .map_err(drawing)?;
        for (colour, curve) in COLOURS.into_iter().cycle().zip(curves) {
            let points = || curve.points.iter().copied();
            chart
                .draw_series(LineSeries::new(points(), colour.stroke_width(2)))
                .map_err(drawing)?
                .label(&curve.name)
                .legend(swatch(colour));
            let dots = points().map(|point| Circle::new(point, 4, colour.filled()));
            chart.draw_series(dots).map_err(drawing)?;
        }
        legend(&mut chart)
    })
}
