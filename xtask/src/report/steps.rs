//! In which SYNC the axes started and arrived, move by move.

use std::fmt::Write as _;

use anyhow::Result;
use canmaster_sim::judge::{Edge, Span};
use canmaster_sim::time::Time;
use canmaster_sim::world::Record;

/// Axes that were told to move at the same time.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Move {
    spans: Vec<Span>,
}

/// Spans that overlap are one move.
fn moves(spans: &[Span]) -> Vec<Move> {
    let mut all: Vec<Move> = Vec::new();
    let mut until = Time::ZERO;
    for span in spans {
        match all.last_mut() {
            Some(last) if span.start.at <= until => last.spans.push(*span),
            _ => all.push(Move { spans: vec![*span] }),
        }
        until = until.max(span.end.at);
    }
    all
}

/// The axes by the SYNC that `edge` says, in the order of the SYNCs. Those of
/// different buses are less than `apart` from each other.
fn by_sync(spans: &[Span], apart: Time, edge: fn(&Span) -> Edge) -> Vec<(Edge, Vec<usize>)> {
    let mut all: Vec<(Edge, Vec<usize>)> = Vec::new();
    let mut sorted = spans.to_vec();
    sorted.sort_by_key(|span| edge(span).at);
    for span in sorted {
        let edge = edge(&span);
        match all.last_mut() {
            Some((last, axes)) if edge.at.since(last.at) < apart => axes.push(span.axis),
            _ => all.push((edge, vec![span.axis])),
        }
    }
    for (_, axes) in &mut all {
        axes.sort_unstable();
    }
    all
}

/// The table, below a heading.
pub(super) fn table(page: &mut String, record: &Record) -> Result<()> {
    let moves = moves(&record.spans);
    if moves.is_empty() {
        return Ok(());
    }
    let apart = Time(Time::from(record.machine.network().cycle).0 / 2);
    let node = |axis: usize| record.axes.get(axis).map_or(0, |axis| axis.node.get());
    write!(
        page,
        "<h2>Start and arrival</h2>\n<p>By the set values on the wire: the SYNC with which axes \
         are told to start, and the one with which they are told to move for the last time.</p>\n\
         <table class=\"facts\"><tr><th>move</th><th>start</th><th>arrival</th></tr>\n"
    )?;
    for (number, of_move) in (1..).zip(&moves) {
        let start = words(&by_sync(&of_move.spans, apart, |span| span.start), node);
        let end = words(&by_sync(&of_move.spans, apart, |span| span.end), node);
        writeln!(
            page,
            "<tr><td>{number}</td><td>{start}</td><td>{end}</td></tr>"
        )?;
    }
    page.push_str("</table>\n");
    Ok(())
}

fn words(by_sync: &[(Edge, Vec<usize>)], node: impl Fn(usize) -> u8) -> String {
    let group = |(edge, axes): &(Edge, Vec<usize>)| {
        let nodes: Vec<String> = axes.iter().map(|&axis| node(axis).to_string()).collect();
        let nodes = nodes.join(", ");
        format!("SYNC {} ({} s): nodes {nodes}", edge.sync, edge.at)
    };
    by_sync.iter().map(group).collect::<Vec<_>>().join("<br>")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(axis: usize, start: usize, end: usize) -> Span {
        let edge = |sync: usize| Edge {
            sync,
            at: Time::from_ms(10 * sync as u64),
        };
        Span {
            axis,
            start: edge(start),
            end: edge(end),
        }
    }

    #[test]
    fn axes_that_move_together_are_one_move() {
        let spans = [
            span(0, 5, 20),
            span(1, 5, 30),
            span(0, 25, 40),
            span(1, 50, 60),
        ];
        let found = moves(&spans);
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].spans.len(), 3);
    }

    #[test]
    fn the_axes_of_a_sync_stand_together() {
        let spans = [span(0, 5, 20), span(1, 5, 30), span(2, 5, 20)];
        let start = words(
            &by_sync(&spans, Time::from_ms(5), |span| span.start),
            |axis| axis as u8 + 1,
        );
        assert_eq!(start, "SYNC 5 (0.050000 s): nodes 1, 2, 3");
        let end = words(
            &by_sync(&spans, Time::from_ms(5), |span| span.end),
            |axis| axis as u8 + 1,
        );
        assert_eq!(
            end,
            "SYNC 20 (0.200000 s): nodes 1, 3<br>SYNC 30 (0.300000 s): nodes 2"
        );
    }
}
