//! What a finished request yields.

use crate::id::Address;

/// The most bytes that a [`Client`](super::Client) sends or receives in one
/// request: enough for every number, key and device name.
pub const RESPONSE_MAX: usize = 32;

/// The result of a finished upload or download.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Response {
    /// The entry that was read or written.
    pub at: Address,
    len: u8,
    data: [u8; RESPONSE_MAX],
}

impl Response {
    pub(super) const fn empty(at: Address) -> Response {
        Response {
            at,
            len: 0,
            data: [0; RESPONSE_MAX],
        }
    }

    /// Makes `data` the content; `false` if it does not fit.
    pub(super) fn append(&mut self, data: &[u8]) -> bool {
        let from = usize::from(self.len);
        let to = from + data.len();
        match self.data.get_mut(from..to) {
            Some(space) => {
                space.copy_from_slice(data);
                self.len = to as u8;
                true
            }
            None => false,
        }
    }

    /// The bytes read or written.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// The data as an unsigned number, if it has 1..=4 bytes.
    pub fn as_u32(&self) -> Option<u32> {
        let mut bytes = [0; 4];
        let data = self.data();
        if data.is_empty() {
            return None;
        }
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(u32::from_le_bytes(bytes))
    }

    /// The data as a signed number, if it has 1, 2 or 4 bytes.
    pub fn as_i32(&self) -> Option<i32> {
        match *self.data() {
            [a] => Some(i32::from(a as i8)),
            [a, b] => Some(i32::from(i16::from_le_bytes([a, b]))),
            [a, b, c, d] => Some(i32::from_le_bytes([a, b, c, d])),
            _ => None,
        }
    }

    /// The data as text up to the first NUL, if it is UTF-8.
    pub fn as_str(&self) -> Option<&str> {
        let data = self.data().split(|&byte| byte == 0).next()?;
        core::str::from_utf8(data).ok()
    }
}
