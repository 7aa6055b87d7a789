//! A classical CAN frame with an 11-bit identifier.

use crate::id::CobId;
use embedded_can::{Id, StandardId};

/// The most data bytes that a classical CAN frame carries.
pub const MAX_DATA: usize = 8;

/// A classical CAN data or remote frame with an 11-bit identifier.
///
/// Bytes past `len` are zero, so that equal frames compare equal. Aligned so that it
/// is copied word by word: it goes through several queues.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(align(4))]
pub struct Frame {
    id: CobId,
    len: u8,
    remote: bool,
    data: [u8; MAX_DATA],
}

impl Frame {
    /// A data frame. `None` if `data` is longer than 8 bytes.
    pub fn data_frame(id: CobId, data: &[u8]) -> Option<Frame> {
        let mut bytes = [0; MAX_DATA];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Frame {
            id,
            len: data.len() as u8,
            remote: false,
            data: bytes,
        })
    }

    /// A data frame of the first `len` bytes, at most eight, of `data`; the others
    /// have to be zero.
    pub(crate) const fn of_padded(id: CobId, len: u8, data: [u8; MAX_DATA]) -> Frame {
        Frame {
            id,
            len,
            remote: false,
            data,
        }
    }

    /// A data frame of eight bytes, as every SDO and LSS frame is.
    pub const fn full(id: CobId, data: [u8; MAX_DATA]) -> Frame {
        Frame {
            id,
            len: MAX_DATA as u8,
            remote: false,
            data,
        }
    }

    /// A data frame without data: a SYNC without counter.
    pub const fn empty(id: CobId) -> Frame {
        Frame {
            id,
            len: 0,
            remote: false,
            data: [0; MAX_DATA],
        }
    }

    /// A remote frame (node guarding, CiA 301, 7.2.8.3.2.1). `None` if
    /// `dlc` exceeds 8.
    pub const fn remote_frame(id: CobId, dlc: u8) -> Option<Frame> {
        if dlc as usize > MAX_DATA {
            return None;
        }
        Some(Frame {
            id,
            len: dlc,
            remote: true,
            data: [0; MAX_DATA],
        })
    }

    /// The identifier.
    pub const fn id(&self) -> CobId {
        self.id
    }

    /// The data: empty for a remote frame, whatever its DLC says.
    pub fn data(&self) -> &[u8] {
        let len = if self.remote { 0 } else { self.len as usize };
        self.data.get(..len).unwrap_or(&[])
    }

    /// All eight data bytes, those past the DLC being zero.
    pub const fn padded(&self) -> [u8; MAX_DATA] {
        self.data
    }

    /// The data length code, 0..=8.
    pub const fn dlc(&self) -> u8 {
        self.len
    }

    /// Whether this is a remote transmission request.
    pub const fn is_remote(&self) -> bool {
        self.remote
    }
}

impl embedded_can::Frame for Frame {
    /// `None` for extended identifiers: CANopen as used here has none.
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Frame> {
        match id.into() {
            Id::Standard(id) => Frame::data_frame(id.into(), data),
            Id::Extended(_) => None,
        }
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Frame> {
        match id.into() {
            Id::Standard(id) => Frame::remote_frame(id.into(), u8::try_from(dlc).ok()?),
            Id::Extended(_) => None,
        }
    }

    fn is_extended(&self) -> bool {
        false
    }

    fn is_remote_frame(&self) -> bool {
        self.remote
    }

    fn id(&self) -> Id {
        Id::Standard(StandardId::from(self.id))
    }

    fn dlc(&self) -> usize {
        self.len as usize
    }

    fn data(&self) -> &[u8] {
        Frame::data(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, Frame as _};

    #[test]
    fn length_is_checked() {
        for len in 0..=12 {
            let made = Frame::data_frame(CobId::NMT, &[0xA5; 12][..len]);
            assert_eq!(made.is_some(), len <= 8);
        }
        assert!(Frame::remote_frame(CobId::NMT, 9).is_none());
    }

    #[test]
    fn a_sync_is_a_data_frame_without_data() {
        let sync = Frame::empty(CobId::SYNC);
        assert!(sync.is_data_frame());
        assert_eq!(embedded_can::Frame::dlc(&sync), 0);
        assert_eq!(Frame::data(&sync), &[] as &[u8]);
    }

    #[test]
    fn extended_identifiers_are_refused() {
        let id = ExtendedId::new(0x1234_5678).unwrap();
        assert!(<Frame as embedded_can::Frame>::new(id, &[]).is_none());
        assert!(<Frame as embedded_can::Frame>::new_remote(id, 0).is_none());
    }
}
