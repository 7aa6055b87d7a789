//! The object dictionary as its users see it: SDO server and PDO mapping
//! (CiA 301, 7.4).
//!
//! A device implements [`ObjectDictionary`]. Numbers are read and written as a
//! whole through [`ObjectDictionary::get`] and [`set`](ObjectDictionary::set);
//! strings and domains of any length are streamed. Existence, access, length
//! and range are checked once, here, by [`Entry`], so that an implementation
//! only holds the values and its own special rules. [`Table`] and [`Values`]
//! make a dictionary of a constant list.

mod entry;
mod table;
mod value;

pub use entry::{Access, Entry, Mappable};
pub use table::{Object, Table, Values};
pub use value::{DataType, VALUE_MAX, Value};

use crate::id::Address;
use crate::sdo::AbortCode;

/// A piece of a string or domain as it is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// How many bytes were put into the buffer. Fewer than it holds only where
    /// the data ends.
    pub len: usize,
    /// The size of the whole if it is known.
    pub size: Option<u32>,
    /// Nothing follows.
    pub last: bool,
}

/// A piece of a string or domain as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part<'a> {
    /// Where it belongs: parts come in order and without gaps.
    pub offset: u32,
    /// The bytes. Empty only in an empty last part.
    pub data: &'a [u8],
    /// The size of the whole if the client told it.
    pub size: Option<u32>,
    /// Nothing follows: length and checksum are right, the value may be taken
    /// over.
    pub last: bool,
}

/// An object dictionary.
pub trait ObjectDictionary {
    /// Type, access, mappability and range of an entry.
    ///
    /// # Errors
    /// 06020000h if the object, 06090011h if the sub-index does not exist.
    fn entry(&self, at: Address) -> Result<Entry, AbortCode>;

    /// Type and access of an entry alone.
    ///
    /// # Errors
    /// As [`entry`](Self::entry).
    fn kind(&mut self, at: Address) -> Result<(DataType, Access), AbortCode> {
        let entry = self.entry(at)?;
        Ok((entry.data_type, entry.access))
    }

    /// Whether an entry takes a value, of the type that it has.
    ///
    /// # Errors
    /// 06090030h if the value is out of the range that [`entry`](Self::entry) has.
    fn in_range(&self, at: Address, value: Value) -> Result<(), AbortCode> {
        self.entry(at)?.in_range(value)
    }

    /// The value of an entry whose type has a fixed size. Access has been
    /// checked.
    ///
    /// # Errors
    /// What the device has to say, 08000022h for instance.
    fn get(&mut self, at: Address) -> Result<Value, AbortCode>;

    /// Takes over the value of an entry whose type has a fixed size. Access,
    /// type and range have been checked.
    ///
    /// # Errors
    /// What the device has to say, 08000022h for instance.
    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode>;

    /// Copies a string or domain from `offset` on into `buf`.
    ///
    /// # Errors
    /// 06010000h unless implemented.
    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        let _ = (at, offset, buf);
        Err(AbortCode::UNSUPPORTED_ACCESS)
    }

    /// Takes a part of a string or domain. The old value stays until the last
    /// part has come.
    ///
    /// # Errors
    /// 06010000h unless implemented.
    fn write(&mut self, at: Address, part: Part<'_>) -> Result<(), AbortCode> {
        let _ = (at, part);
        Err(AbortCode::UNSUPPORTED_ACCESS)
    }

    /// The transfer that wrote `at` ended before its last part.
    fn cancel(&mut self, at: Address) {
        let _ = at;
    }
}

/// Reads an entry of fixed size, access checked.
///
/// # Errors
/// As an SDO upload would be answered.
pub fn upload(od: &mut impl ObjectDictionary, at: Address) -> Result<Value, AbortCode> {
    od.entry(at)?.readable()?;
    od.get(at)
}

/// Writes an entry of fixed size, everything checked.
///
/// # Errors
/// As an SDO download would be answered.
pub fn download(od: &mut impl ObjectDictionary, at: Address, data: &[u8]) -> Result<(), AbortCode> {
    let entry = od.entry(at)?;
    entry.writable()?;
    let value = Value::from_bytes(entry.data_type, data)?;
    entry.in_range(value)?;
    od.set(at, value)
}

/// A dictionary whose objects have numbers only can do without streams; this
/// helper serves a constant string to [`ObjectDictionary::read`].
pub fn read_bytes(whole: &[u8], offset: u32, buf: &mut [u8]) -> Chunk {
    let rest = usize::try_from(offset)
        .ok()
        .and_then(|offset| whole.get(offset..))
        .unwrap_or(&[]);
    let len = rest.len().min(buf.len());
    if let (Some(to), Some(from)) = (buf.get_mut(..len), rest.get(..len)) {
        to.copy_from_slice(from);
    }
    Chunk {
        len,
        size: u32::try_from(whole.len()).ok(),
        last: len == rest.len(),
    }
}
