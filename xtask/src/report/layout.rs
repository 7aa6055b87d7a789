//! The cycle as it is laid out, at its worst: a lane for each bus.

use anyhow::Result;
use canmaster_network::layout::{Layout, Slot, SlotKind};
use canmaster_network::model::Bus;
use plotters::prelude::*;

use super::charts::{COLOURS, FAINT, FONT, INK, drawing, style, svg};

/// Colours of what is on the wire, and what it is called.
const KINDS: [(SlotKind, RGBColor, &str); 7] = [
    (SlotKind::Sync, INK, "SYNC"),
    (SlotKind::Tpdo, COLOURS[0], "TPDOs"),
    (SlotKind::Planned, COLOURS[1], "planned"),
    (SlotKind::Rpdo, COLOURS[2], "RPDOs"),
    (SlotKind::Other, COLOURS[3], "not planned"),
    (SlotKind::Compute, COLOURS[5], "master computes"),
    (SlotKind::Guard, FAINT, "guard"),
];
const NS_PER_US: f64 = 1000.0;
/// Of a lane, and of all that is around them.
const LANE: u32 = 56;
const AROUND: u32 = 92;
/// Pixels from one word of the legend to the next.
const LEGEND: i32 = 128;
/// Frames stand above the middle of a lane, the rest below.
const FRAMES: (f64, f64) = (-0.06, 0.42);
const BELOW: (f64, f64) = (-0.3, -0.12);

/// All buses to the same scale.
pub(crate) fn picture(buses: &[Bus]) -> Result<String> {
    let rows = buses.len() as f64;
    let longest = buses.iter().map(|bus| bus.cycle_us).max().unwrap_or(1);
    svg(AROUND + LANE * buses.len() as u32, |area| {
        for (place, (_, colour, name)) in KINDS.iter().enumerate() {
            let x = 24 + LEGEND * place as i32;
            let square = [(x, 10), (x + 12, 22)];
            area.draw(&Rectangle::new(square, colour.filled()))
                .map_err(drawing)?;
            let font = (FONT, 12).into_font().color(&INK);
            area.draw(&Text::new(*name, (x + 17, 10), font))
                .map_err(drawing)?;
        }
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .margin_top(34)
            .margin_right(24)
            .x_label_area_size(38)
            .y_label_area_size(110)
            .build_cartesian_2d(0.0..f64::from(longest), 0.0..rows)
            .map_err(drawing)?;
        style(chart.configure_mesh())
            .disable_y_mesh()
            .disable_y_axis()
            .x_desc("microseconds from the timer's event, at worst")
            .x_label_formatter(&|us| format!("{us:.0}"))
            .draw()
            .map_err(drawing)?;
        for (row, bus) in buses.iter().enumerate() {
            let middle = rows - row as f64 - 0.5;
            for (slot, colour) in drawn(&bus.layout) {
                let (low, high) = heights(slot.kind);
                let corners = [
                    (slot.start_ns as f64 / NS_PER_US, middle + low),
                    (slot.end_ns() as f64 / NS_PER_US, middle + high),
                ];
                let plot = chart.plotting_area();
                plot.draw(&Rectangle::new(corners, colour.filled()))
                    .map_err(drawing)?;
                // Frames of a kind are told apart.
                plot.draw(&Rectangle::new(corners, WHITE.stroke_width(1)))
                    .map_err(drawing)?;
            }
            if let Some(window) = bus.layout.sdo_window()
                && bus.layout.demand.is_planned()
            {
                let line = vec![
                    (f64::from(window.from_us), middle + BELOW.0 - 0.06),
                    (f64::from(window.until_us), middle + BELOW.0 - 0.06),
                ];
                let line = PathElement::new(line, COLOURS[4].stroke_width(4));
                chart.plotting_area().draw(&line).map_err(drawing)?;
            }
            let (x, y) = chart.backend_coord(&(0.0, middle));
            let font = (FONT, 13).into_font().color(&INK);
            area.draw(&Text::new(bus.name.clone(), (x - 100, y - 7), font))
                .map_err(drawing)?;
        }
        Ok(())
    })
}

/// What there is to be seen; the guard stands where it ends: at the end.
fn drawn(layout: &Layout) -> impl Iterator<Item = (Slot, RGBColor)> {
    layout.slots.iter().filter_map(|slot| {
        let (_, colour, _) = KINDS.iter().find(|(kind, ..)| *kind == slot.kind)?;
        let mut slot = slot.clone();
        if slot.kind == SlotKind::Guard {
            let cycle_ns = u64::from(layout.cycle_us) * NS_PER_US as u64;
            slot.start_ns = cycle_ns.saturating_sub(slot.length_ns);
        }
        (slot.length_ns > 0).then_some((slot, *colour))
    })
}

fn heights(kind: SlotKind) -> (f64, f64) {
    match kind {
        SlotKind::Compute => BELOW,
        SlotKind::Guard => (BELOW.0, FRAMES.1),
        _ => FRAMES,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cargo;

    #[test]
    fn every_frame_of_every_bus_is_drawn() {
        for (name, lanes) in [("one_bus_2ms", 1), ("three_bus_1ms_full", 3)] {
            let path = cargo::workspace().join(format!("networks/{name}.toml"));
            let machine = canmaster_network::load(&path).machine.unwrap();
            assert_eq!(machine.buses.len(), lanes);
            let text = picture(&machine.buses).unwrap();
            let slots: usize = machine
                .buses
                .iter()
                .map(|bus| drawn(&bus.layout).count())
                .sum();
            // Filled and outlined, besides the page and the legend.
            let boxes = text.matches("<rect ").count();
            assert!(boxes >= 2 * slots + KINDS.len(), "{boxes}, {slots}");
            for bus in &machine.buses {
                assert!(text.contains(&format!("\n{}\n", bus.name)), "{}", bus.name);
            }
        }
    }
}
