//! 2F12h: test data are transferred to or from a node by SDO, to see whether
//! cable and node stand the full traffic before anything moves.

use super::dictionary::Dictionary;
use super::node_record::NodeRecord;
use crate::id::{Address, NodeId};
use crate::sdo::{AbortCode, Protocol};

/// What is to be transferred: the record 2F12h, of which every entry is an
/// UNSIGNED32.
///
/// | sub | what | access |
/// | --- | --- | --- |
/// | 1 | the entry in the node: index (bits 31..16), sub-index (15..8), node-ID (7..0) | rw |
/// | 2 | how many bytes | rw |
/// | 3 | seed of the data, see [`TestData`](crate::sdo::TestData) | rw |
/// | 4 | starts: 1 segmented download, 2 segmented upload, 3 block download, 4 block upload | wo |
/// | 5 | bytes that were transferred | ro |
/// | 6 | microseconds that it took | ro |
/// | 7 | 0 = every byte was transferred and is right; FFFFFFFFh = under way; else the abort code; 08000024h before the first | ro |
///
/// Starting is refused with 06090030h for other commands and where there is no
/// node-ID, with 08000022h while an axis is enabled, while the node
/// is in its boot-up, and while another transfer is under way. Data that come
/// wrong end an upload with 06090030h, too few or too many with 06070010h.
///
/// Whoever has the bus carries it out while it [is under
/// way](TransferTest::is_under_way), and tells its [end](TransferTest::end).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransferTest([u32; WORDS]);

const WORDS: usize = 7;
/// Places in the record, counted from 0.
const COMMAND: usize = 3;

const SEGMENTED_DOWNLOAD: u32 = 1;
const BLOCK_DOWNLOAD: u32 = 3;
const BLOCK_UPLOAD: u32 = 4;

/// The result of one that is under way.
const UNDER_WAY: u32 = u32::MAX;

impl TransferTest {
    pub(super) const NONE: TransferTest = TransferTest([0, 0, 0, 0, 0, 0, AbortCode::NO_DATA.0]);

    const fn target(&self) -> u32 {
        self.0[0]
    }

    /// Which entry of the node.
    pub const fn at(&self) -> Address {
        let [_, sub, low, high] = self.target().to_le_bytes();
        Address::new(u16::from_le_bytes([low, high]), sub)
    }

    /// Whose server; `None` for a number that is no node-ID.
    pub const fn node(&self) -> Option<NodeId> {
        NodeId::new(self.target() as u8)
    }

    /// How many bytes.
    pub const fn size(&self) -> u32 {
        self.0[1]
    }

    /// Seed of the data.
    pub const fn seed(&self) -> u32 {
        self.0[2]
    }

    /// From the node; else to it.
    pub const fn is_upload(&self) -> bool {
        self.0[COMMAND] & 1 == 0
    }

    /// In segments or in blocks.
    pub const fn protocol(&self) -> Protocol {
        if self.0[COMMAND] < BLOCK_DOWNLOAD {
            Protocol::Normal
        } else {
            Protocol::Block
        }
    }

    /// It was started and has not ended.
    pub const fn is_under_way(&self) -> bool {
        self.0[WORDS - 1] == UNDER_WAY
    }

    /// It has ended after `us` microseconds and `bytes` bytes, with every one
    /// transferred or with a code.
    pub const fn end(&mut self, bytes: u32, us: u32, result: Result<(), AbortCode>) {
        let code = match result {
            Ok(()) => 0,
            Err(code) => code.0,
        };
        let [target, size, seed, command, ..] = self.0;
        self.0 = [target, size, seed, command, bytes, us, code];
    }

    /// The word at a place.
    pub(super) fn word(&self, place: usize) -> u32 {
        self.0.get(place).copied().unwrap_or(0)
    }
}

impl<const N: usize> Dictionary<N> {
    pub(super) fn set_transfer_word(&mut self, place: usize, word: u32) -> Result<(), AbortCode> {
        let test = &self.transfer;
        if place == COMMAND {
            let exists = (SEGMENTED_DOWNLOAD..=BLOCK_UPLOAD).contains(&word);
            let node = test.node().filter(|_| exists);
            let node = node.ok_or(AbortCode::VALUE_RANGE)?;
            let booting = |(_, record): (_, &NodeRecord)| record.status.is_in_boot_up();
            if self.axes_enabled || test.is_under_way() || self.node(node).is_some_and(booting) {
                return Err(AbortCode::DEVICE_STATE);
            }
            self.transfer.end(0, 0, Err(AbortCode(UNDER_WAY)));
        }
        if let Some(old) = self.transfer.0.get_mut(place) {
            *old = word;
        }
        Ok(())
    }
}
