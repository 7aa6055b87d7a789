//! What is written into the object dictionary and what is read from it, whatever
//! the protocol between.

use crate::id::Address;
use crate::od::{Chunk, DataType, ObjectDictionary, Part, VALUE_MAX, Value, read_bytes};
use crate::sdo::AbortCode;

/// A transfer within the server, in either direction.
///
/// A value of fixed size is collected here and written once, complete and
/// checked; or read once, so that all its segments are of one moment. Strings and
/// domains are handed on piece by piece.
#[derive(Clone, Copy, Debug)]
// In this order, so that what is used most is near: it takes shorter instructions.
#[repr(C)]
pub(super) struct Transfer {
    pub(super) at: Address,
    data_type: DataType,
    /// How many bytes the client said it would send, or was told it would get.
    pub(super) size: Option<u32>,
    /// How many of them have been transferred in order.
    offset: u32,
    value: [u8; VALUE_MAX],
}

impl Transfer {
    pub(super) const NONE: Transfer = Transfer::of(Address::new(0, 0), DataType::Domain, None);

    const fn of(at: Address, data_type: DataType, size: Option<u32>) -> Transfer {
        Transfer {
            at,
            data_type,
            size,
            offset: 0,
            value: [0; VALUE_MAX],
        }
    }

    /// Begins a download: checks existence, access and, where it is known, the
    /// size.
    pub(super) fn open_download(
        &mut self,
        od: &mut impl ObjectDictionary,
        at: Address,
        size: Option<u32>,
    ) -> Result<(), AbortCode> {
        let (data_type, access) = od.kind(at)?;
        access.writable()?;
        if let (Some(told), Some(needed)) = (size, data_type.size()) {
            check_length(told, needed as u32)?;
        }
        *self = Transfer::of(at, data_type, size);
        Ok(())
    }

    /// Begins an upload: checks existence and access.
    pub(super) fn open_upload(
        &mut self,
        od: &mut impl ObjectDictionary,
        at: Address,
    ) -> Result<(), AbortCode> {
        let (data_type, access) = od.kind(at)?;
        access.readable()?;
        *self = Transfer::of(at, data_type, None);
        if self.is_stream() {
            self.size = od.read(at, 0, &mut [])?.size;
        } else {
            let value = od.get(at)?;
            self.size = Some(value.len().into());
            self.value = value.padded();
        }
        Ok(())
    }

    /// How many bytes the type takes; `None` for strings and domains.
    pub(super) const fn fixed_size(&self) -> Option<usize> {
        self.data_type.size()
    }

    /// A string or a domain.
    const fn is_stream(&self) -> bool {
        self.fixed_size().is_none()
    }

    /// Takes the next bytes of a download.
    pub(super) fn push(
        &mut self,
        od: &mut impl ObjectDictionary,
        data: &[u8],
        last: bool,
    ) -> Result<(), AbortCode> {
        let (at, offset, size) = (self.at, self.offset, self.size);
        let received = offset
            .checked_add(data.len() as u32)
            .ok_or(AbortCode::TOO_LONG)?;
        match size {
            Some(size) if last || received > size => check_length(received, size)?,
            _ => {}
        }
        self.offset = received;
        if self.is_stream() {
            return od.write(
                at,
                Part {
                    offset,
                    data,
                    size,
                    last,
                },
            );
        }
        let (whole, _) = self
            .value
            .split_at_mut_checked(received as usize)
            .ok_or(AbortCode::TOO_LONG)?;
        if let Some(space) = whole.get_mut(offset as usize..) {
            space.copy_from_slice(data);
        }
        if last {
            let value = Value::from_bytes(self.data_type, whole)?;
            od.in_range(at, value)?;
            od.set(at, value)?;
        }
        Ok(())
    }

    /// A download ended without its last part.
    pub(super) fn cancel(&self, od: &mut impl ObjectDictionary) {
        if self.is_stream() {
            od.cancel(self.at);
        }
    }

    /// Copies the next bytes of an upload into `buf`.
    ///
    /// # Errors
    /// As of [`read`](Self::read).
    pub(super) fn next(
        &mut self,
        od: &mut impl ObjectDictionary,
        buf: &mut [u8],
    ) -> Result<Chunk, AbortCode> {
        let chunk = self.read(od, self.offset, buf)?;
        let offset = self.offset.checked_add(chunk.len as u32);
        self.offset = offset.ok_or(AbortCode::GENERAL)?;
        Ok(chunk)
    }

    /// Copies the bytes of an upload from `offset` on into `buf`.
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
        if !self.is_stream() {
            let len = self.size.unwrap_or(0) as usize;
            let value = self.value.get(..len).unwrap_or(&self.value);
            return Ok(read_bytes(value, offset, buf));
        }
        let chunk = od.read(self.at, offset, buf)?;
        // A length past the buffer, or a gap, would be a fault of the dictionary.
        if chunk.len > buf.len() || chunk.len < buf.len() && !chunk.last {
            return Err(AbortCode::GENERAL);
        }
        if chunk.size != self.size {
            return Err(AbortCode::DEVICE_STATE);
        }
        Ok(chunk)
    }
}

fn check_length(told: u32, needed: u32) -> Result<(), AbortCode> {
    if told > needed {
        Err(AbortCode::TOO_LONG)
    } else if told < needed {
        Err(AbortCode::TOO_SHORT)
    } else {
        Ok(())
    }
}
