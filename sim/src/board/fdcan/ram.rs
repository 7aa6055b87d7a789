//! Message RAM of one instance: fixed sections and their elements
//! (RM0440, 44.3.6 and 44.3.7).

use crate::frame::{WireFrame, WireId};

/// Words of one instance's section: 0x350 bytes.
pub(crate) const WORDS: usize = 0x350 / 4;
/// Elements of each Rx FIFO, of the Tx event FIFO and of the Tx buffers.
pub(crate) const DEPTH: usize = 3;

pub(super) const STANDARD_FILTERS: usize = 0;
pub(super) const EXTENDED_FILTERS: usize = 0x070 / 4;
pub(super) const RX_FIFO: [usize; 2] = [0x0B0 / 4, 0x188 / 4];
pub(super) const TX_EVENTS: usize = 0x260 / 4;
pub(super) const TX_BUFFERS: usize = 0x278 / 4;
/// Words of a received or sent element: two of header, 64 bytes of data.
pub(super) const ELEMENT_WORDS: usize = 18;
pub(super) const EVENT_WORDS: usize = 2;

const ESI: u32 = 1 << 31;
const XTD: u32 = 1 << 30;
const RTR: u32 = 1 << 29;
const STANDARD_SHIFT: u32 = 18;
const STANDARD_MASK: u32 = 0x7FF;
const EXTENDED_MASK: u32 = 0x1FFF_FFFF;
const DLC_SHIFT: u32 = 16;
const DLC_MASK: u32 = 0xF;
const FDF: u32 = 1 << 21;
const MARKER_SHIFT: u32 = 24;
const EFC: u32 = 1 << 23;
const ANMF: u32 = 1 << 31;
const FIDX_SHIFT: u32 = 24;
/// Event type: a frame was sent; sent in spite of cancellation.
const ET_SENT: u32 = 0b01 << 22;
const ET_SENT_CANCELLED: u32 = 0b10 << 22;

/// The message RAM of one instance.
#[derive(Debug, Clone)]
pub(crate) struct MessageRam {
    words: [u32; WORDS],
}

/// A Tx buffer element as the hardware reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TxElement {
    /// What goes on the wire.
    pub frame: WireFrame,
    /// FDF: the element asks for the FD format.
    pub fd: bool,
    /// EFC: store a Tx event.
    pub event: bool,
    /// MM: copied into the Tx event.
    pub marker: u8,
    /// Header words, for the Tx event.
    header: [u32; 2],
}

/// Why a frame was accepted: what the Rx element says about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Acceptance {
    /// FIDX; `None` sets ANMF (accepted though no filter matched).
    pub filter: Option<u8>,
    /// RXTS.
    pub timestamp: u16,
}

impl Default for MessageRam {
    fn default() -> Self {
        Self { words: [0; WORDS] }
    }
}

impl MessageRam {
    /// Fills the RAM with what it happens to hold after power-on.
    pub(crate) fn scramble(&mut self, pattern: u32) {
        self.words = [pattern; WORDS];
    }

    /// The word at `index`; 0 beyond the end.
    #[must_use]
    pub(crate) fn word(&self, index: usize) -> u32 {
        self.words.get(index).copied().unwrap_or(0)
    }

    /// Writes the word at `index`.
    pub(crate) fn set_word(&mut self, index: usize, value: u32) {
        if let Some(word) = self.words.get_mut(index) {
            *word = value;
        }
    }

    /// The Tx buffer that the word at `index` belongs to.
    #[must_use]
    pub(crate) fn tx_buffer_of(index: usize) -> Option<usize> {
        let offset = index.checked_sub(TX_BUFFERS)?;
        let buffer = offset / ELEMENT_WORDS;
        (buffer < DEPTH).then_some(buffer)
    }

    /// Reads Tx buffer `buffer`.
    #[must_use]
    pub(crate) fn tx_element(&self, buffer: usize) -> TxElement {
        let base = TX_BUFFERS + buffer * ELEMENT_WORDS;
        let header = [self.word(base), self.word(base + 1)];
        let [t0, t1] = header;
        let id = if t0 & XTD != 0 {
            WireId::Extended(t0 & EXTENDED_MASK)
        } else {
            WireId::Standard((t0 >> STANDARD_SHIFT & STANDARD_MASK) as u16)
        };
        let mut data = [0; 8];
        for (k, chunk) in data.chunks_exact_mut(4).enumerate() {
            chunk.copy_from_slice(&self.word(base + 2 + k).to_le_bytes());
        }
        let rtr = t0 & RTR != 0;
        let mut frame = WireFrame {
            id,
            rtr,
            dlc: (t1 >> DLC_SHIFT & DLC_MASK) as u8,
            data,
        };
        // What lies behind the data length is not sent.
        let len = frame.len();
        frame.data[len..].fill(0);
        TxElement {
            frame,
            fd: t1 & FDF != 0,
            event: t1 & EFC != 0,
            marker: (t1 >> MARKER_SHIFT) as u8,
            header,
        }
    }

    /// Stores a received frame as element `index` of FIFO `fifo`.
    pub(crate) fn store_rx(
        &mut self,
        fifo: usize,
        index: usize,
        frame: &WireFrame,
        why: Acceptance,
    ) {
        let base = RX_FIFO[fifo] + index * ELEMENT_WORDS;
        let id = match frame.id {
            WireId::Standard(id) => u32::from(id) << STANDARD_SHIFT,
            WireId::Extended(id) => id | XTD,
        };
        let rtr = if frame.rtr { RTR } else { 0 };
        let filter = why.filter.map_or(ANMF, |k| u32::from(k) << FIDX_SHIFT);
        self.set_word(base, id | rtr);
        self.set_word(
            base + 1,
            filter | u32::from(frame.dlc) << DLC_SHIFT | u32::from(why.timestamp),
        );
        // Only as many words as the data length needs are written.
        for (k, chunk) in frame.payload().chunks(4).enumerate() {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            self.set_word(base + 2 + k, u32::from_le_bytes(word));
        }
    }

    /// Stores a Tx event as element `index`.
    pub(crate) fn store_event(
        &mut self,
        index: usize,
        tx: &TxElement,
        cancelled: bool,
        timestamp: u16,
    ) {
        let base = TX_EVENTS + index * EVENT_WORDS;
        let kind = if cancelled {
            ET_SENT_CANCELLED
        } else {
            ET_SENT
        };
        let [t0, t1] = tx.header;
        self.set_word(base, t0 & !ESI);
        self.set_word(
            base + 1,
            u32::from(tx.marker) << MARKER_SHIFT
                | kind
                | t1 & DLC_MASK << DLC_SHIFT
                | u32::from(timestamp),
        );
    }
}
