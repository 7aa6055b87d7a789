//! Acceptance filtering (RM0440, 44.3.6: "Acceptance filter").

use super::bits::{field, rxgfc};
use super::ram::{EXTENDED_FILTERS, MessageRam, STANDARD_FILTERS};
use crate::frame::{WireFrame, WireId};

/// What the filters decide about a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Verdict {
    /// The FIFO that it goes to.
    pub(super) fifo: Option<usize>,
    /// The element that matched.
    pub(super) filter: Option<u8>,
    /// The element sets the high-priority message interrupt.
    pub(super) priority: bool,
}

impl Verdict {
    const REJECT: Self = Self {
        fifo: None,
        filter: None,
        priority: false,
    };

    /// SFEC/EFEC of a matching element; `None` where the element is off.
    const fn of_element(configuration: u32, index: u8) -> Option<Self> {
        let (fifo, priority) = match configuration {
            1 => (Some(0), false),
            2 => (Some(1), false),
            3 => (None, false),
            4 => (None, true),
            5 => (Some(0), true),
            6 => (Some(1), true),
            _ => return None,
        };
        Some(Self {
            fifo,
            filter: Some(index),
            priority,
        })
    }

    /// ANFS/ANFE: what happens to frames that match nothing.
    const fn of_non_matching(setting: u32) -> Self {
        let fifo = match setting {
            0 => Some(0),
            1 => Some(1),
            _ => None,
        };
        Self {
            fifo,
            filter: None,
            priority: false,
        }
    }
}

/// Runs a frame through the filter list of its identifier's format.
pub(super) fn accept(ram: &MessageRam, gfc: u32, xidam: u32, frame: &WireFrame) -> Verdict {
    match frame.id {
        WireId::Standard(id) => {
            if frame.rtr && gfc & rxgfc::RRFS != 0 {
                return Verdict::REJECT;
            }
            let used = gfc >> rxgfc::LSS_SHIFT & rxgfc::LSS_MASK;
            (0..used.min(28))
                .find_map(|k| standard(ram, k as u8, u32::from(id)))
                .unwrap_or_else(|| Verdict::of_non_matching(field(gfc, rxgfc::ANFS_SHIFT, 2)))
        }
        WireId::Extended(id) => {
            if frame.rtr && gfc & rxgfc::RRFE != 0 {
                return Verdict::REJECT;
            }
            let used = gfc >> rxgfc::LSE_SHIFT & rxgfc::LSE_MASK;
            (0..used.min(8))
                .find_map(|k| extended(ram, k as u8, id, xidam))
                .unwrap_or_else(|| Verdict::of_non_matching(field(gfc, rxgfc::ANFE_SHIFT, 2)))
        }
    }
}

fn standard(ram: &MessageRam, index: u8, id: u32) -> Option<Verdict> {
    let element = ram.word(STANDARD_FILTERS + usize::from(index));
    let verdict = Verdict::of_element(field(element, 27, 3), index)?;
    let (id1, id2) = (field(element, 16, 11), field(element, 0, 11));
    let hit = match field(element, 30, 2) {
        0 => id1 <= id && id <= id2,
        1 => id == id1 || id == id2,
        2 => id & id2 == id1 & id2,
        _ => false,
    };
    hit.then_some(verdict)
}

fn extended(ram: &MessageRam, index: u8, id: u32, xidam: u32) -> Option<Verdict> {
    let base = EXTENDED_FILTERS + usize::from(index) * 2;
    let (f0, f1) = (ram.word(base), ram.word(base + 1));
    let verdict = Verdict::of_element(field(f0, 29, 3), index)?;
    let (id1, id2) = (field(f0, 0, 29), field(f1, 0, 29));
    let masked = id & xidam;
    let hit = match field(f1, 30, 2) {
        0 => id1 <= masked && masked <= id2,
        1 => masked == id1 || masked == id2,
        2 => masked & id2 == id1 & id2,
        // A range without XIDAM.
        _ => id1 <= id && id <= id2,
    };
    hit.then_some(verdict)
}
