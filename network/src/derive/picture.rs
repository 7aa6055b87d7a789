//! A cycle as a line of text.

use crate::layout::{Layout, Slot, SlotKind};

/// Letters of the picture and what they stand for.
const LETTERS: [(SlotKind, char, &str); 8] = [
    (SlotKind::Sync, 'S', "SYNC"),
    (SlotKind::Latency, '.', "drives answer"),
    (SlotKind::Tpdo, 'T', "TPDOs"),
    (SlotKind::Planned, 'p', "planned"),
    (SlotKind::Other, 'o', "heartbeats, EMCY, SDO"),
    (SlotKind::Compute, 'c', "master computes"),
    (SlotKind::Rpdo, 'R', "RPDOs"),
    (SlotKind::Guard, '|', "guard"),
];

const NS_PER_US: u64 = 1000;

/// The cycle to scale in `width` letters, and what they mean. What does not fit
/// into the cycle is left out; the guard stands at its end.
pub fn picture(layout: &Layout, width: usize) -> String {
    let cycle_ns = u64::from(layout.cycle_us.max(1)) * NS_PER_US;
    let column = |ns: u64| (ns.min(cycle_ns) * width as u64 / cycle_ns) as usize;
    let mut line = vec![' '; width];
    let mut slots: Vec<&Slot> = layout.slots.iter().collect();
    // What is on the wire meanwhile is drawn over the computation; and SYNC is seen,
    // however short it is.
    slots.sort_by_key(|slot| match slot.kind {
        SlotKind::Compute => 0,
        SlotKind::Sync => 2,
        _ => 1,
    });
    for slot in slots {
        let Some((_, letter, _)) = LETTERS.iter().find(|(kind, ..)| *kind == slot.kind) else {
            continue;
        };
        let (start, end) = match slot.kind {
            SlotKind::Guard => (cycle_ns.saturating_sub(slot.length_ns), cycle_ns),
            _ => (slot.start_ns, slot.start_ns + slot.length_ns),
        };
        let first = column(start);
        // Even the shortest is seen.
        let last = column(end).max(first + usize::from(slot.length_ns > 0));
        for place in line.iter_mut().take(last).skip(first) {
            *place = *letter;
        }
    }
    let line: String = line.into_iter().collect();
    let legend: Vec<String> = LETTERS
        .iter()
        .filter(|(kind, ..)| {
            layout
                .slots
                .iter()
                .any(|s| s.kind == *kind && s.length_ns > 0)
        })
        .map(|(_, letter, what)| format!("{letter} {what}"))
        .collect();
    format!("[{line}]\n {}", legend.join("   "))
}
