//! What the group and the drives were in, over time.

use anyhow::Result;
use canmaster_sim::drive::cia402::State;
use canmaster_sim::time::Time;
use canmaster_sim::world::Record;
use plotters::prelude::*;

use super::charts::{FAINT, FONT, HARM, INK, drawing, style, svg};

/// How the firmware begins what it logs of the group.
const GROUP: &str = "group: ";
/// Between the states before and after.
const ARROW: &str = " -> ";
/// Height of a lane in pixels, and of what is above and below all.
const LANE: u32 = 30;
const AROUND: u32 = 70;
/// Pixels of a letter, more or less.
const LETTER: i32 = 7;

const OFF: RGBColor = RGBColor(232, 232, 232);
const READY: RGBColor = RGBColor(205, 222, 236);
const STANDBY: RGBColor = RGBColor(170, 205, 232);
const ENABLED: RGBColor = RGBColor(178, 220, 201);
const STOPPING: RGBColor = RGBColor(245, 211, 150);
const FAULT: RGBColor = RGBColor(238, 172, 152);

/// A stretch of time in one state.
#[derive(Clone, Debug, PartialEq)]
struct Stretch {
    from: Time,
    until: Time,
    label: String,
    colour: RGBColor,
}

/// One row of the picture.
#[derive(Clone, Debug, PartialEq)]
struct Lane {
    name: String,
    stretches: Vec<Stretch>,
}

/// The picture.
pub(super) fn chart(record: &Record) -> Result<String> {
    draw(&lanes(record), &record.marks, record.simulated)
}

fn lanes(record: &Record) -> Vec<Lane> {
    let end = record.simulated;
    let log = record.log.iter();
    let group = log.filter_map(|(at, line)| Some((*at, group_state(&line.message)?)));
    let group = group.map(|(at, state)| (at, state.to_string(), colour_of_group(state)));
    let mut lanes = vec![Lane {
        name: "group".into(),
        stretches: stretches(group, end),
    }];
    lanes.extend(record.axes.iter().map(|axis| {
        let states = axis.states.iter().map(|state| {
            let label = format!("{} ({})", mode(state.mode), words(state.state));
            (state.at, label, colour(state.state))
        });
        Lane {
            name: format!("node {}", axis.node.get()),
            stretches: stretches(states, end),
        }
    }));
    lanes
}

/// The state that the group has gone to, if the line tells of that.
fn group_state(message: &str) -> Option<&str> {
    let (_, change) = message.split_once(GROUP)?;
    let (_, to) = change.split_once(ARROW)?;
    // Some lines go on with what to do.
    let end = to.find(|c: char| !(c.is_alphabetic() || c == ' '));
    Some(to[..end.unwrap_or(to.len())].trim())
}

fn stretches(changes: impl Iterator<Item = (Time, String, RGBColor)>, end: Time) -> Vec<Stretch> {
    let mut all: Vec<Stretch> = Vec::new();
    for (from, label, colour) in changes {
        if let Some(last) = all.last_mut() {
            last.until = from;
        }
        all.push(Stretch {
            from,
            until: end,
            label,
            colour,
        });
    }
    all
}

fn colour_of_group(state: &str) -> RGBColor {
    match state {
        "idle" => OFF,
        "enabling" | "disabling" | "mode change" => READY,
        "standby" => STANDBY,
        "moving" | "homing" => ENABLED,
        "faulted" | "stopping after a fault" => FAULT,
        _ => STOPPING,
    }
}

fn colour(state: State) -> RGBColor {
    match state {
        State::NotReadyToSwitchOn | State::SwitchOnDisabled => OFF,
        State::ReadyToSwitchOn | State::SwitchedOn => READY,
        State::OperationEnabled => ENABLED,
        State::QuickStopActive => STOPPING,
        State::FaultReactionActive | State::Fault => FAULT,
    }
}

/// The mode as the field abbreviates it.
fn mode(code: i8) -> &'static str {
    match code {
        1 => "PP",
        3 => "PV",
        6 => "HM",
        8 => "CSP",
        9 => "CSV",
        10 => "CST",
        _ => "?",
    }
}

fn words(state: State) -> &'static str {
    match state {
        State::NotReadyToSwitchOn => "not ready",
        State::SwitchOnDisabled => "switch on disabled",
        State::ReadyToSwitchOn => "ready",
        State::SwitchedOn => "switched on",
        State::OperationEnabled => "operation enabled",
        State::QuickStopActive => "quick stop",
        State::FaultReactionActive => "fault reaction",
        State::Fault => "fault",
    }
}

fn draw(lanes: &[Lane], harms: &[(Time, String)], end: Time) -> Result<String> {
    let rows = lanes.len() as f64;
    let end = end.as_secs_f64().max(f64::MIN_POSITIVE);
    svg(AROUND + LANE * lanes.len() as u32, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .margin_right(24)
            .x_label_area_size(38)
            .y_label_area_size(72)
            .build_cartesian_2d(0.0..end, 0.0..rows)
            .map_err(drawing)?;
        style(chart.configure_mesh())
            .disable_y_mesh()
            .disable_y_axis()
            .x_desc("seconds from power-on")
            .draw()
            .map_err(drawing)?;
        for (row, lane) in lanes.iter().enumerate() {
            let middle = rows - row as f64 - 0.5;
            for stretch in &lane.stretches {
                let (from, until) = (stretch.from.as_secs_f64(), stretch.until.as_secs_f64());
                let corners = [(from, middle - 0.4), (until.min(end), middle + 0.4)];
                let plot = chart.plotting_area();
                plot.draw(&Rectangle::new(corners, stretch.colour.filled()))
                    .map_err(drawing)?;
                let (left, y) = chart.backend_coord(&(from, middle));
                let (right, _) = chart.backend_coord(&(until, middle));
                if right - left < LETTER * stretch.label.len() as i32 {
                    continue;
                }
                area.draw(&Text::new(
                    stretch.label.as_str(),
                    (left + 4, y - 6),
                    (FONT, 12).into_font().color(&INK),
                ))
                .map_err(drawing)?;
            }
            let (x, y) = chart.backend_coord(&(0.0, middle));
            area.draw(&Text::new(
                lane.name.as_str(),
                (x - 64, y - 7),
                (FONT, 13).into_font().color(&INK),
            ))
            .map_err(drawing)?;
            let line = PathElement::new(vec![(0.0, middle - 0.5), (end, middle - 0.5)], FAINT);
            chart.plotting_area().draw(&line).map_err(drawing)?;
        }
        for (at, _) in harms {
            let x = at.as_secs_f64();
            let line = DashedLineSeries::new([(x, 0.0), (x, rows)], 4, 3, HARM.stroke_width(2));
            chart.draw_series(line).map_err(drawing)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_group_is_read_from_the_log() {
        for (line, state) in [
            ("group: idle -> enabling", Some("enabling")),
            (
                "group: stopping after a fault -> faulted: remove the cause",
                Some("faulted"),
            ),
            (
                "group: moving -> stopping after a fault",
                Some("stopping after a fault"),
            ),
            ("node 3: emergency 2310h", None),
            ("group: nothing", None),
        ] {
            assert_eq!(group_state(line), state, "{line}");
        }
    }

    #[test]
    fn a_state_lasts_until_the_next() {
        let ms = Time::from_ms;
        let changes = [
            (ms(10), "a".to_string(), OFF),
            (ms(30), "b".to_string(), READY),
        ];
        let found = stretches(changes.into_iter(), ms(100));
        let times: Vec<_> = found.iter().map(|s| (s.from, s.until)).collect();
        assert_eq!(times, [(ms(10), ms(30)), (ms(30), ms(100))]);
        let lane = Lane {
            name: "group".into(),
            stretches: found,
        };
        let text = draw(&[lane], &[(ms(50), "fault".into())], ms(100)).unwrap();
        assert!(text.contains("group") && text.contains(">\na"), "{text}");
        assert!(draw(&[], &[], Time::ZERO).unwrap().starts_with("<svg"));
    }
}
