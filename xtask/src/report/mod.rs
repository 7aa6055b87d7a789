//! `target/run/report.html`: one file, nothing loaded from elsewhere.

mod charts;
mod frames;
mod lanes;
pub(crate) mod layout;
pub(crate) mod plot;
mod steps;

use std::fmt::Write as _;

use anyhow::Result;
use canmaster_network::model::Bus;
use canmaster_sim::judge::Outcome;
use canmaster_sim::world::{BusRecord, Record};

use crate::run::summary::Summary;
use charts::{Curve, Marks, OverTime};

const STYLE: &str = "\
:root{color-scheme:light}
body{font:16px/1.5 system-ui,sans-serif;color:#333;background:#fff;max-width:1040px;margin:2rem auto;padding:0 1rem}
h1{font-size:1.5rem;margin:0 0 .25rem}h2{font-size:1.1rem;margin:2.2rem 0 .4rem}
p{margin:.3rem 0;max-width:46rem}
.badge{display:inline-block;padding:.1rem .6rem;border-radius:.3rem;color:#fff;font-weight:600}
.ok{background:#00795a}.failed{background:#b3321b}.incomplete{background:#8a6200}
table{border-collapse:collapse;margin:.5rem 0;font-variant-numeric:tabular-nums}
th,td{padding:.2rem .8rem;text-align:right;border-bottom:1px solid #e1e1e1}
th{font-weight:600;text-align:right}td:first-child,th:first-child{text-align:left;padding-left:0}
.facts td:last-child{text-align:left}
svg{display:block;margin:.3rem 0}
footer{margin:2.5rem 0;color:#666;font-size:.9rem}";

/// The whole page.
pub(crate) fn html(record: &Record, summary: &Summary, laid_out: &[Bus]) -> Result<String> {
    let mut page = String::new();
    let title = format!("canmaster: run with seed {}", record.seed);
    write!(
        page,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title}</title><style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    )?;
    verdict(&mut page, record)?;
    axes(&mut page, record)?;
    write!(
        page,
        "<h2>The cycle as it is laid out</h2>\n<p>At worst: every frame with the most stuff bits, \
         every drive as slow as it may be. The red line is when SDO requests may be handed over, \
         where they are planned.</p>\n{}\n",
        layout::picture(laid_out)?
    )?;
    for bus in &record.buses {
        bus_cycle(&mut page, record, bus)?;
    }
    for bus in &record.buses {
        jitter(&mut page, record, bus)?;
    }
    figures(&mut page, summary)?;
    write!(
        page,
        "<footer>The firmware image ran on an emulated board, with a bus and drives in virtual \
         time. Motion is judged in the plant and frames on the wire; but for the state of the \
         group nothing here is reported by the firmware about itself. Emulation knows no analogue effects, no transceivers and no \
         flash wait states.</footer>\n</body></html>\n"
    )?;
    Ok(page)
}

fn verdict(page: &mut String, record: &Record) -> Result<()> {
    let outcome = record.verdict.outcome;
    let words = match outcome {
        Outcome::Ok => "every move of every drive arrived",
        _ => &record.verdict.reason,
    };
    writeln!(
        page,
        "<p><span class=\"badge {outcome}\">{outcome}</span> {}</p>",
        escape(words)
    )?;
    Ok(())
}

fn axes(page: &mut String, record: &Record) -> Result<()> {
    let curves = curves(record);
    for (heading, words, what) in motion(record) {
        write!(
            page,
            "<h2>{heading} of all axes</h2>\n<p>{words} Shaded: motion was released. Triangle: the \
             SYNC with which the axis is told to start; dot: the one with which it is told to move \
             for the last time; red: what was done to the machine.</p>\n{}\n",
            charts::over_time(&what, &curves, marks(record))?
        )?;
    }
    write!(
        page,
        "<h2>States</h2>\n<p>The group as the firmware logs it; the drives, with their modes of \
         operation, as they are.</p>\n{}\n",
        lanes::chart(record)?
    )?;
    steps::table(page, record)
}

/// What is marked in the pictures over time.
fn marks(record: &Record) -> Marks<'_> {
    Marks {
        releases: &record.releases,
        spans: &record.spans,
        harms: &record.marks,
    }
}

/// Position and velocity, one above the other, as a picture of its own.
pub(crate) fn picture(record: &Record) -> Result<String> {
    let curves = curves(record);
    let panels: Result<Vec<String>> = motion(record)
        .iter()
        .map(|(_, _, what)| charts::over_time(what, &curves, marks(record)))
        .collect();
    Ok(charts::stacked(&panels?))
}

fn curves(record: &Record) -> Vec<Curve<'_>> {
    let assignment = record.machine.assignment();
    let mut sets: Vec<u8> = Vec::new();
    let of_axis = |(axis, of_axis): (usize, &'_ canmaster_sim::world::AxisRecord)| {
        let set = assignment
            .of_axis(axis)
            .next()
            .map_or(0, |(_, part)| part.set);
        let dashed = sets.contains(&set);
        sets.push(set);
        (format!("node {}", of_axis.node.get()), dashed)
    };
    let names: Vec<(String, bool)> = record.axes.iter().enumerate().map(of_axis).collect();
    names
        .into_iter()
        .zip(&record.axes)
        .map(|((label, dashed), axis)| Curve {
            label,
            points: axis.motion.trace(),
            dashed,
        })
        .collect()
}

/// Heading, explanation, and what is drawn.
fn motion(record: &Record) -> [(&'static str, &'static str, OverTime<'static>); 2] {
    let end = record.simulated;
    [
        (
            "Position",
            "From where each stood at power-on. The second axis of a pair is dashed: it lies on the first.",
            OverTime {
                caption: "position",
                unit: "increments",
                value: |point, first| point.position - first.position,
                end,
            },
        ),
        (
            "Velocity",
            "True velocity of the shafts.",
            OverTime {
                caption: "velocity",
                unit: "rpm",
                value: |point, _| point.velocity,
                end,
            },
        ),
    ]
}

/// What tells the buses apart in a heading: nothing where there is only one.
fn of_bus(record: &Record, bus: &BusRecord) -> String {
    if record.buses.len() == 1 {
        return String::new();
    }
    format!(" \"{}\"", escape(&bus.name))
}

fn bus_cycle(page: &mut String, record: &Record, bus: &BusRecord) -> Result<()> {
    let Some((from, to)) = frames::chosen_cycle(record, bus) else {
        return Ok(());
    };
    let lanes = frames::lanes(record, bus, from, to);
    let name = of_bus(record, bus);
    let cycle_us = to.since(from).as_us_f64();
    let busy_us = frames::busy_until(&lanes);
    write!(
        page,
        "<h2>One cycle of the bus{name}, to scale</h2>\n<p>The cycle that begins at {from} s. \
         Colours are the nodes' of the curves above; black is the master alone.</p>\n{}\n",
        charts::cycle(&lanes, 0.0, cycle_us)?
    )?;
    if busy_us < cycle_us * 0.7 {
        write!(
            page,
            "<p>Its busy part, enlarged:</p>\n{}\n",
            charts::cycle(&lanes, 0.0, busy_us * 1.05)?
        )?;
    }
    Ok(())
}

fn jitter(page: &mut String, record: &Record, bus: &BusRecord) -> Result<()> {
    let (name, bus) = (of_bus(record, bus), &bus.figures);
    write!(
        page,
        "<h2>SYNC jitter{name}</h2>\n<p>{} SYNC frames; {:.2} us peak to peak, period {:.3} us.</p>\n{}\n",
        bus.sync_count,
        bus.jitter_pp_us,
        bus.sync_period_us,
        charts::histogram(&bus.sync_residuals_us)?
    )?;
    Ok(())
}

fn figures(page: &mut String, summary: &Summary) -> Result<()> {
    write!(page, "<h2>Drives</h2>\n<table><tr>")?;
    for heading in Summary::DRIVE_HEADING {
        write!(page, "<th>{heading}</th>")?;
    }
    page.push_str("</tr>\n");
    for drive in summary.drive_rows() {
        page.push_str("<tr>");
        for cell in drive {
            write!(page, "<td>{}</td>", escape(&cell))?;
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table>\n<h2>Figures</h2>\n<table class=\"facts\">\n");
    for (name, value) in summary.facts() {
        writeln!(
            page,
            "<tr><td>{}</td><td>{}</td></tr>",
            escape(name),
            escape(&value)
        )?;
    }
    page.push_str("</table>\n");
    Ok(())
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
