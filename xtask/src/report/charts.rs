//! The report's pictures, as SVG.

use anyhow::{Result, anyhow};
use canmaster_sim::judge::{Release, Span, TracePoint};
use canmaster_sim::time::Time;
use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::frames::Lane;

/// Two scales with curves between them.
type Plot<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// One colour per axis, told apart by colour-blind people too (after Okabe and
/// Ito); they repeat after six.
pub(super) const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(86, 180, 233),
];
pub(super) const INK: RGBColor = RGBColor(51, 51, 51);
pub(super) const FAINT: RGBColor = RGBColor(225, 225, 225);
/// Where something was done to the machine.
pub(super) const HARM: RGBColor = RGBColor(179, 50, 27);
/// Behind the time in which motion was released.
const RELEASED: RGBColor = RGBColor(244, 247, 251);
pub(super) const FONT: &str = "sans-serif";
pub(super) const WIDTH: u32 = 1000;
/// Of a picture over time.
const MOTION_HEIGHT: u32 = 380;
/// Points of a curve at most.
const POINTS: usize = 800;
/// Instead of a size.
const SCALES: &str = "style=\"width:100%;height:auto\"";
/// Where the columns of the histogram begin: its scale is logarithmic, so that
/// a single late frame among thousands is seen.
const FLOOR: f64 = 0.5;
/// Columns of the histogram at most.
const BINS: usize = 60;

/// One curve.
pub(super) struct Curve<'r> {
    pub(super) label: String,
    pub(super) points: &'r [TracePoint],
    /// Distinguishes axes that do the same: the second of a pair is dashed.
    pub(super) dashed: bool,
}

/// What is drawn over time.
pub(super) struct OverTime<'r> {
    pub(super) caption: &'r str,
    pub(super) unit: &'r str,
    /// From a point and the first point of its curve.
    pub(super) value: fn(&TracePoint, &TracePoint) -> f64,
    pub(super) end: Time,
}

/// What is marked in a picture over time.
#[derive(Clone, Copy)]
pub(super) struct Marks<'r> {
    /// Motion was released.
    pub(super) releases: &'r [Release],
    /// Starts and arrivals.
    pub(super) spans: &'r [Span],
    /// What was done to the machine.
    pub(super) harms: &'r [(Time, String)],
}

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

pub(super) fn svg(height: u32, draw: impl FnOnce(&Area<'_>) -> Result<()>) -> Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
        area.fill(&WHITE).map_err(drawing)?;
        draw(&area)?;
        area.present().map_err(drawing)?;
    }
    // Scales with the page.
    Ok(text.replacen(&format!("width=\"{WIDTH}\" height=\"{height}\""), SCALES, 1))
}

pub(super) fn drawing(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("cannot draw: {error}")
}

/// Position or velocity of all axes over time.
pub(super) fn over_time(
    what: &OverTime<'_>,
    curves: &[Curve<'_>],
    marks: Marks<'_>,
) -> Result<String> {
    let end = what.end.as_secs_f64().max(f64::MIN_POSITIVE);
    let values = curves
        .iter()
        .flat_map(|curve| points(what, curve))
        .map(|(_, value)| value);
    let (low, high) = range(values);
    svg(MOTION_HEIGHT, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .margin_right(24)
            .x_label_area_size(38)
            .y_label_area_size(72)
            .build_cartesian_2d(0.0..end, low..high)
            .map_err(drawing)?;
        let bands = marks.releases.iter().map(|release| {
            let from = release.at.as_secs_f64();
            let to = release.done.map_or(end, Time::as_secs_f64);
            Rectangle::new([(from, low), (to, high)], RELEASED.filled())
        });
        chart.draw_series(bands).map_err(drawing)?;
        style(chart.configure_mesh())
            .x_desc("seconds from power-on")
            .y_desc(format!("{} [{}]", what.caption, what.unit))
            .y_label_formatter(&whole)
            .draw()
            .map_err(drawing)?;
        for (at, words) in marks.harms {
            let x = at.as_secs_f64();
            let line = DashedLineSeries::new([(x, low), (x, high)], 4, 3, HARM.stroke_width(2));
            chart.draw_series(line).map_err(drawing)?;
            let place = chart.backend_coord(&(x, high));
            area.draw(&Text::new(
                words.as_str(),
                (place.0 + 5, place.1 + 3),
                (FONT, 13).into_font().color(&HARM),
            ))
            .map_err(drawing)?;
        }
        for (colour, curve) in COLOURS.iter().cycle().zip(curves) {
            let style = colour.stroke_width(2);
            let points = points(what, curve);
            let series = if curve.dashed {
                chart.draw_series(DashedLineSeries::new(points, 7, 5, style))
            } else {
                chart.draw_series(LineSeries::new(points, style))
            };
            let colour = *colour;
            series
                .map_err(drawing)?
                .label(&curve.label)
                .legend(swatch(colour));
        }
        let at = |axis: usize, at: Time| {
            let curve = curves.get(axis)?;
            let point = curve.points.iter().find(|point| point.at >= at)?;
            let first = curve.points.first()?;
            Some((at.as_secs_f64(), (what.value)(point, first)))
        };
        for span in marks.spans {
            let colour = COLOURS[span.axis % COLOURS.len()];
            let start =
                at(span.axis, span.start.at).map(|c| TriangleMarker::new(c, 6, colour.filled()));
            chart.draw_series(start).map_err(drawing)?;
            let end = at(span.axis, span.end.at).map(|c| Circle::new(c, 4, colour.filled()));
            chart.draw_series(end).map_err(drawing)?;
        }
        legend(&mut chart)
    })
}

/// A piece of a curve, for the legend.
pub(super) fn swatch(colour: RGBColor) -> impl Fn((i32, i32)) -> PathElement<(i32, i32)> {
    move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(3))
}

/// Which curve is which.
pub(super) fn legend<'a>(chart: &mut Plot<'a, 'a>) -> Result<()> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(FAINT)
        .label_font((FONT, 13).into_font().color(&INK))
        .draw()
        .map_err(drawing)
}

/// A curve's points, thinned out to what can be seen.
fn points<'c>(
    what: &OverTime<'_>,
    curve: &Curve<'c>,
) -> impl Iterator<Item = (f64, f64)> + Clone + 'c {
    let value = what.value;
    let all = curve.points;
    let step = all.len().div_ceil(POINTS).max(1);
    let first = all.first().into_iter().cycle();
    all.iter()
        .step_by(step)
        .zip(first)
        .map(move |(point, first)| (point.at.as_secs_f64(), value(point, first)))
}

/// Pictures over time, one above the other, as one picture.
pub(super) fn stacked(panels: &[String]) -> String {
    let height = MOTION_HEIGHT as usize * panels.len();
    let mut text =
        format!("<svg viewBox=\"0 0 {WIDTH} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n");
    for (place, panel) in panels.iter().enumerate() {
        let y = MOTION_HEIGHT as usize * place;
        text.push_str(&format!("<g transform=\"translate(0 {y})\">\n"));
        // Nested, it needs its size again.
        let size = format!("width=\"{WIDTH}\" height=\"{MOTION_HEIGHT}\"");
        text.push_str(&panel.replacen(SCALES, &size, 1));
        text.push_str("</g>\n");
    }
    text.push_str("</svg>\n");
    text
}

/// One cycle of the bus, to scale: a lane for each kind of frame.
pub(super) fn cycle(lanes: &[Lane], from_us: f64, to_us: f64) -> Result<String> {
    let rows = lanes.len() as f64;
    let height = 70 + 34 * lanes.len() as u32;
    svg(height, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .margin_right(24)
            .x_label_area_size(38)
            .y_label_area_size(110)
            .build_cartesian_2d(from_us..to_us, 0.0..rows)
            .map_err(drawing)?;
        let name = |y: &f64| {
            let row = rows - 1.0 - (y - 0.5).round();
            lanes
                .get(row.max(0.0) as usize)
                .map_or(String::new(), |lane| lane.name.clone())
        };
        style(chart.configure_mesh())
            .disable_y_mesh()
            .disable_y_axis()
            .x_desc("microseconds from the SYNC's start of frame")
            .x_label_formatter(&whole)
            .draw()
            .map_err(drawing)?;
        for (row, lane) in lanes.iter().enumerate() {
            let middle = rows - row as f64 - 0.5;
            chart
                .plotting_area()
                .draw(&PathElement::new(
                    vec![(from_us, middle), (to_us, middle)],
                    FAINT,
                ))
                .map_err(drawing)?;
            let boxes = lane
                .frames
                .iter()
                .filter(|frame| frame.end_us > from_us && frame.start_us < to_us);
            for frame in boxes {
                let colour = frame.axis.map_or(INK, |axis| COLOURS[axis % COLOURS.len()]);
                let corners = [
                    (frame.start_us.max(from_us), middle - 0.36),
                    (frame.end_us.min(to_us), middle + 0.36),
                ];
                chart
                    .plotting_area()
                    .draw(&Rectangle::new(corners, colour.filled()))
                    .map_err(drawing)?;
            }
            // Lane names stand outside of the plot, in its pixel coordinates.
            let (x, y) = chart.backend_coord(&(from_us, middle));
            area.draw(&Text::new(
                name(&middle),
                (x - 100, y - 7),
                (FONT, 13).into_font().color(&INK),
            ))
            .map_err(drawing)?;
        }
        Ok(())
    })
}

/// How late the SYNCs were.
pub(super) fn histogram(residuals_us: &[f64]) -> Result<String> {
    let (low, high) = range(residuals_us.iter().copied());
    let bins = BINS.min(residuals_us.len().max(1));
    let width = (high - low) / bins as f64;
    let mut counts = vec![0_u32; bins];
    for value in residuals_us {
        let bin = ((value - low) / width) as usize;
        counts[bin.min(bins - 1)] += 1;
    }
    let most = f64::from(counts.iter().copied().max().unwrap_or(0).max(1));
    svg(300, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .margin_right(24)
            .x_label_area_size(38)
            .y_label_area_size(72)
            .build_cartesian_2d(low..high, (FLOOR..most * 1.5).log_scale())
            .map_err(drawing)?;
        style(chart.configure_mesh())
            .x_desc("start of frame against the best-fit grid [us]")
            .y_desc("SYNC frames")
            .y_label_formatter(&whole)
            .draw()
            .map_err(drawing)?;
        let bars = counts
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
            .map(|(bin, count)| {
                let left = low + width * bin as f64;
                Rectangle::new(
                    [(left, FLOOR), (left + width, f64::from(*count))],
                    COLOURS[0].filled(),
                )
            });
        chart.draw_series(bars).map_err(drawing)?;
        Ok(())
    })
}

/// What all axes have in common.
pub(super) fn style<'a, 'b, X, Y, DB: DrawingBackend>(
    mut mesh: MeshStyle<'a, 'b, X, Y, DB>,
) -> MeshStyle<'a, 'b, X, Y, DB>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    mesh.light_line_style(TRANSPARENT)
        .bold_line_style(FAINT)
        .axis_style(INK)
        .label_style((FONT, 13).into_font().color(&INK))
        .axis_desc_style((FONT, 14).into_font().color(&INK));
    mesh
}

fn whole(value: &f64) -> String {
    format!("{value:.0}")
}

/// Smallest and largest value with some air; never empty.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
    if low > high {
        return (-1.0, 1.0);
    }
    let air = ((high - low) * 0.05).max(0.05);
    (low - air, high + air)
}

#[cfg(test)]
mod tests {
    use super::super::frames::Block;
    use super::*;
    use canmaster_sim::judge::Edge;

    const NOTHING: Marks<'static> = Marks {
        releases: &[],
        spans: &[],
        harms: &[],
    };

    #[test]
    fn starts_arrivals_and_harm_are_marked() {
        let what = OverTime {
            caption: "velocity",
            unit: "rpm",
            value: |point, _| point.velocity,
            end: Time::from_s(2),
        };
        let point = |ms, velocity| TracePoint {
            at: Time::from_ms(ms),
            position: 0.0,
            velocity,
        };
        let points = [point(0, 0.0), point(500, 300.0), point(2000, 0.0)];
        let curve = Curve {
            label: "node 1".into(),
            points: &points,
            dashed: false,
        };
        let edge = |sync, ms| Edge {
            sync,
            at: Time::from_ms(ms),
        };
        let marks = Marks {
            spans: &[Span {
                axis: 0,
                start: edge(1, 100),
                end: edge(5, 500),
            }],
            harms: &[(Time::from_s(1), "short circuit".into())],
            ..NOTHING
        };
        let text = over_time(&what, &[curve], marks).unwrap();
        assert!(text.contains("short circuit"));
        assert!(
            text.contains("<circle") && text.contains("<polygon"),
            "{text}"
        );
    }

    #[test]
    fn every_picture_can_be_drawn_of_nothing() {
        let what = OverTime {
            caption: "velocity",
            unit: "rpm",
            value: |point, _| point.velocity,
            end: Time::ZERO,
        };
        for text in [
            over_time(&what, &[], NOTHING).unwrap(),
            cycle(&[], 0.0, 10.0).unwrap(),
            histogram(&[]).unwrap(),
        ] {
            assert!(text.starts_with("<svg"), "{text}");
        }
    }

    #[test]
    fn frames_have_their_length_in_the_picture() {
        let block = |start_us, end_us| Block {
            start_us,
            end_us,
            axis: None,
        };
        let lanes = [Lane {
            name: "SYNC".into(),
            frames: vec![block(0.0, 100.0), block(500.0, 700.0)],
        }];
        let text = cycle(&lanes, 0.0, 1000.0).unwrap();
        let widths: Vec<u32> = text
            .split("<rect ")
            .filter_map(|part| part.split("/>").next())
            .filter(|part| part.contains("#333333"))
            .filter_map(|part| {
                part.split("width=\"")
                    .nth(1)?
                    .split('"')
                    .next()?
                    .parse()
                    .ok()
            })
            .collect();
        assert_eq!(widths.len(), 2, "{text}");
        assert!(widths[1].abs_diff(2 * widths[0]) <= 1, "{widths:?}");
    }

    #[test]
    fn every_sync_is_in_the_histogram() {
        let text = histogram(&[-1.0, -0.5, 0.0, 0.5, 1.0]).unwrap();
        assert!(text.matches("<rect ").count() >= 5);
    }
}
