//! Putting numbers into a PDO and getting them out, where the layout is known
//! to the compiler.

use super::PDO_MAX;
use crate::frame::Frame;
use crate::id::CobId;

/// Fills a PDO field by field, little-endian. What does not fit into eight
/// bytes is left out and noticed by [`Writer::frame`].
#[derive(Clone, Copy, Debug, Default)]
#[must_use = "the bytes go into a frame"]
pub struct Writer {
    data: [u8; PDO_MAX],
    len: usize,
}

/// Takes a PDO apart field by field, little-endian. A field that the PDO is too
/// short for is `None`.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl Writer {
    /// An empty PDO.
    pub const fn new() -> Writer {
        Writer {
            data: [0; PDO_MAX],
            len: 0,
        }
    }

    fn put<const N: usize>(mut self, bytes: [u8; N]) -> Writer {
        let end = self.len + N;
        if let Some(space) = self.data.get_mut(self.len..end) {
            space.copy_from_slice(&bytes);
        }
        self.len = end;
        self
    }

    /// The bytes written; `None` if it was more than eight.
    pub fn bytes(&self) -> Option<&[u8]> {
        self.data.get(..self.len)
    }

    /// The PDO with the identifier `id`; `None` if more than eight bytes were
    /// put in.
    pub fn frame(&self, id: CobId) -> Option<Frame> {
        Frame::data_frame(id, self.bytes()?)
    }
}

impl<'a> Reader<'a> {
    /// Starts with the first field of `data`.
    pub const fn new(data: &'a [u8]) -> Reader<'a> {
        Reader { rest: data }
    }

    fn get<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        Some(*bytes)
    }
}

macro_rules! fields {
    ($($number:ident),*) => {
        impl Writer {
            $(#[doc = concat!("Appends an `", stringify!($number), "`.")]
            pub fn $number(self, number: $number) -> Writer {
                self.put(number.to_le_bytes())
            })*
        }

        impl Reader<'_> {
            $(#[doc = concat!("The next field as `", stringify!($number), "`.")]
            pub fn $number(&mut self) -> Option<$number> {
                Some($number::from_le_bytes(self.get()?))
            })*
        }
    };
}

fields!(u8, u16, u32, i8, i16, i32);
