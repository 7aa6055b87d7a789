//! 2F12h: test data are transferred to or from a node by SDO, to see whether
//! cable and node stand the full traffic before anything moves.

use super::Board;
use super::node_record::NodeRecord;
use super::view::View;
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransferTest {
    target: u32,
    /// How many bytes.
    pub size: u32,
    /// Seed of the data.
    pub seed: u32,
    command: u8,
}

impl TransferTest {
    /// Which entry of the node.
    pub const fn at(&self) -> Address {
        let [_, sub, low, high] = self.target.to_le_bytes();
        Address::new(u16::from_le_bytes([low, high]), sub)
    }

    /// Whose server; `None` for a number that is no node-ID.
    pub const fn node(&self) -> Option<NodeId> {
        NodeId::new(self.target as u8)
    }

    /// From the node; else to it.
    pub const fn is_upload(&self) -> bool {
        self.command & 1 == 0
    }

    /// In segments or in blocks.
    pub const fn protocol(&self) -> Protocol {
        match self.command {
            SEGMENTED_DOWNLOAD | SEGMENTED_UPLOAD => Protocol::Normal,
            _ => Protocol::Block,
        }
    }
}

/// What a transfer came to: 2F12h:05 ..= 07.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransferResult {
    /// Bytes that were transferred.
    pub bytes: u32,
    /// How long it took, in microseconds.
    pub us: u32,
    /// 0: done.
    pub code: u32,
}

impl TransferResult {
    /// There was none yet.
    pub const NONE: TransferResult = TransferResult {
        bytes: 0,
        us: 0,
        code: AbortCode::NO_DATA.0,
    };

    /// The code of one that is under way.
    pub const UNDER_WAY: u32 = u32::MAX;
}

/// Places in the record, counted from 0.
const COMMAND: usize = 3;
const BYTES: usize = 4;
const MICROSECONDS: usize = 5;

const SEGMENTED_DOWNLOAD: u8 = 1;
const SEGMENTED_UPLOAD: u8 = 2;
const BLOCK_UPLOAD: u8 = 4;

impl<B: Board, const N: usize> View<'_, B, N> {
    pub(super) fn transfer_word(&self, place: usize) -> u32 {
        if let Some(word) = self.dictionary.transfer.get(place) {
            return *word;
        }
        let result = self.board.transfer_result();
        match place {
            BYTES => result.bytes,
            MICROSECONDS => result.us,
            _ => result.code,
        }
    }

    pub(super) fn set_transfer_word(&mut self, place: usize, word: u32) -> Result<(), AbortCode> {
        if place == COMMAND {
            return self.start_transfer(word);
        }
        if let Some(old) = self.dictionary.transfer.get_mut(place) {
            *old = word;
        }
        Ok(())
    }

    fn start_transfer(&mut self, command: u32) -> Result<(), AbortCode> {
        let dictionary = &*self.dictionary;
        let [target, size, seed] = dictionary.transfer;
        let test = TransferTest {
            target,
            size,
            seed,
            command: command as u8,
        };
        let commands = SEGMENTED_DOWNLOAD.into()..=BLOCK_UPLOAD.into();
        let node = test.node().filter(|_| commands.contains(&command));
        let node = node.ok_or(AbortCode::VALUE_RANGE)?;
        let booting = |(_, record): (_, &NodeRecord)| record.status.is_in_boot_up();
        if dictionary.axes_enabled || dictionary.node(node).is_some_and(booting) {
            return Err(AbortCode::DEVICE_STATE);
        }
        self.board.start_transfer(test)
    }
}
