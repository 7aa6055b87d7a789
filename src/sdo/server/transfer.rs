//! The two ends of a transfer within the server: what is written into the
//! object dictionary and what is read from it, whatever the protocol between.

use crate::id::Address;
use crate::od::{Chunk, DataType, ObjectDictionary, Part, VALUE_MAX, Value};
use crate::sdo::AbortCode;

/// The receiving end of a download.
///
/// Values of fixed size are collected here and written once, complete and
/// checked; strings and domains are handed on piece by piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sink {
    pub(super) at: Address,
    data_type: DataType,
    /// What the client said it would send.
    size: Option<u32>,
    received: u32,
    value: [u8; VALUE_MAX],
}

impl Sink {
    /// Checks existence, access and, where it is known, the size.
    pub(super) fn open(
        od: &impl ObjectDictionary,
        at: Address,
        size: Option<u32>,
    ) -> Result<Sink, AbortCode> {
        let entry = od.entry(at)?;
        entry.writable()?;
        if let (Some(told), Some(needed)) = (size, entry.data_type.size()) {
            check_length(told, needed)?;
        }
        Ok(Sink {
            at,
            data_type: entry.data_type,
            size,
            received: 0,
            value: [0; VALUE_MAX],
        })
    }

    /// How many bytes the type takes; `None` for strings and domains.
    pub(super) const fn fixed_size(&self) -> Option<usize> {
        self.data_type.size()
    }

    /// Takes the next bytes.
    pub(super) fn push(
        &mut self,
        od: &mut impl ObjectDictionary,
        data: &[u8],
        last: bool,
    ) -> Result<(), AbortCode> {
        let offset = self.received;
        let received = u32::try_from(data.len())
            .ok()
            .and_then(|len| offset.checked_add(len))
            .ok_or(AbortCode::TOO_LONG)?;
        if self.size.is_some_and(|size| received > size) {
            return Err(AbortCode::TOO_LONG);
        }
        if last && self.size.is_some_and(|size| received < size) {
            return Err(AbortCode::TOO_SHORT);
        }
        if self.fixed_size().is_none() {
            let part = Part {
                offset,
                data,
                size: self.size,
                last,
            };
            od.write(self.at, part)?;
        } else {
            self.collect(od, offset, data, last)?;
        }
        self.received = received;
        Ok(())
    }

    fn collect(
        &mut self,
        od: &mut impl ObjectDictionary,
        offset: u32,
        data: &[u8],
        last: bool,
    ) -> Result<(), AbortCode> {
        let from = offset as usize;
        let to = from.saturating_add(data.len());
        let space = self.value.get_mut(from..to).ok_or(AbortCode::TOO_LONG)?;
        space.copy_from_slice(data);
        if last {
            let whole = self.value.get(..to).unwrap_or(&[]);
            let value = Value::from_bytes(self.data_type, whole)?;
            od.in_range(self.at, value)?;
            od.set(self.at, value)?;
        }
        Ok(())
    }

    /// The transfer ended without its last part.
    pub(super) fn cancel(&self, od: &mut impl ObjectDictionary) {
        if self.fixed_size().is_none() {
            od.cancel(self.at);
        }
    }
}

fn check_length(told: u32, needed: usize) -> Result<(), AbortCode> {
    let told = told as usize;
    if told > needed {
        Err(AbortCode::TOO_LONG)
    } else if told < needed {
        Err(AbortCode::TOO_SHORT)
    } else {
        Ok(())
    }
}

/// The sending end of an upload.
///
/// A value of fixed size is read once, so that all its segments are of one
/// moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub(super) at: Address,
    value: Option<Value>,
    /// Of a string or domain when the transfer began, as the client was told.
    size: Option<u32>,
}

impl Source {
    /// Checks existence and access.
    pub(super) fn open(od: &mut impl ObjectDictionary, at: Address) -> Result<Source, AbortCode> {
        let entry = od.entry(at)?;
        entry.readable()?;
        let (value, size) = match entry.data_type.size() {
            Some(_) => (Some(od.get(at)?), None),
            None => (None, od.read(at, 0, &mut [])?.size),
        };
        Ok(Source { at, value, size })
    }

    /// Copies from `offset` on into `buf`.
    ///
    /// # Errors
    /// 08000022h if a string or domain has another size than when the transfer
    /// began: the client was told that one.
    pub(super) fn read(
        &self,
        od: &mut impl ObjectDictionary,
        offset: u32,
        buf: &mut [u8],
    ) -> Result<Chunk, AbortCode> {
        match self.value {
            Some(value) => Ok(crate::od::read_bytes(value.bytes(), offset, buf)),
            None => {
                let chunk = od.read(self.at, offset, buf)?;
                // A length past the buffer would be a fault of the dictionary.
                if chunk.len > buf.len() {
                    return Err(AbortCode::GENERAL);
                }
                if chunk.size != self.size {
                    return Err(AbortCode::DEVICE_STATE);
                }
                Ok(chunk)
            }
        }
    }
}
