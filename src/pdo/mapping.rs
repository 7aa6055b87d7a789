//! Which objects a PDO carries (CiA 301, 7.5.2.36, 7.5.2.38).

use super::{Direction, PDO_MAX};
use crate::id::Address;
use crate::od::{Entry, Mappable, ObjectDictionary, Value};
use crate::sdo::AbortCode;

/// The most entries of a mapping. The standard allows 64; this is what an EPOS4
/// has.
pub const MAPPING_MAX: usize = 12;

/// One mapped object: index, sub-index and length in bits, as the mapping
/// parameters hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MappingEntry(pub u32);

impl MappingEntry {
    /// `bits` of the entry `sub` of the object `index`.
    pub const fn new(index: u16, sub: u8, bits: u8) -> MappingEntry {
        MappingEntry((index as u32) << 16 | (sub as u32) << 8 | bits as u32)
    }

    /// The object mapped.
    pub const fn at(self) -> Address {
        Address::new((self.0 >> 16) as u16, (self.0 >> 8) as u8)
    }

    /// Its length in bits.
    pub const fn bits(self) -> u8 {
        self.0 as u8
    }

    /// Whether an object that the dictionary describes as `entry` can be mapped
    /// like this.
    ///
    /// # Errors
    /// 06040041h if it is not mappable in this direction or has another length.
    pub fn check(self, entry: &Entry, direction: Direction) -> Result<(), AbortCode> {
        let allowed = match direction {
            Direction::Receive => matches!(entry.mappable, Mappable::Rpdo | Mappable::Both),
            Direction::Transmit => matches!(entry.mappable, Mappable::Tpdo | Mappable::Both),
        };
        let size = entry.data_type.size().map(|bytes| bytes * 8);
        if allowed && size == Some(usize::from(self.bits())) {
            Ok(())
        } else {
            Err(AbortCode::NOT_MAPPABLE)
        }
    }
}

/// The objects of one PDO, in their order on the wire: at most
/// [`MAPPING_MAX`] entries and 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mapping {
    len: u8,
    entries: [MappingEntry; MAPPING_MAX],
}

impl Mapping {
    /// No object.
    pub const EMPTY: Mapping = Mapping {
        len: 0,
        entries: [MappingEntry(0); MAPPING_MAX],
    };

    /// `None` if there are more than [`MAPPING_MAX`] entries or 64 bits.
    pub const fn new(entries: &[MappingEntry]) -> Option<Mapping> {
        let mut mapping = Mapping::EMPTY;
        let mut bits = 0;
        let mut from = entries;
        let mut to: &mut [MappingEntry] = &mut mapping.entries;
        while let [entry, rest @ ..] = from {
            let [slot, free @ ..] = to else {
                return None;
            };
            *slot = *entry;
            bits += entry.bits() as usize;
            from = rest;
            to = free;
        }
        if bits > PDO_MAX * 8 {
            return None;
        }
        mapping.len = entries.len() as u8;
        Some(mapping)
    }

    /// The entries.
    pub fn entries(&self) -> &[MappingEntry] {
        self.entries.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// The length of the PDO in whole bytes.
    pub fn bytes(&self) -> usize {
        let bits: usize = self.entries().iter().map(|e| usize::from(e.bits())).sum();
        bits.div_ceil(8).min(PDO_MAX)
    }

    /// Collects the values of a TPDO: the data and how many bytes of it count.
    ///
    /// # Errors
    /// What the dictionary answers for an entry that cannot be read.
    pub fn pack(
        &self,
        od: &mut impl ObjectDictionary,
    ) -> Result<([u8; PDO_MAX], usize), AbortCode> {
        let mut data = 0u64;
        let mut position = 0;
        for entry in self.entries() {
            let mut raw = [0; PDO_MAX];
            let value = od.get(entry.at())?;
            for (to, from) in raw.iter_mut().zip(value.bytes()) {
                *to = *from;
            }
            let bits = u32::from(entry.bits());
            data |= (u64::from_le_bytes(raw) & mask(bits))
                .checked_shl(position)
                .unwrap_or(0);
            position += bits;
        }
        Ok((data.to_le_bytes(), self.bytes()))
    }

    /// Hands the values of an RPDO to the dictionary, in their order. Bytes
    /// past those mapped are ignored. An object that refuses its value does not
    /// keep the others from theirs.
    ///
    /// # Errors
    /// The first object that refused, and why.
    pub fn unpack(
        &self,
        data: [u8; PDO_MAX],
        od: &mut impl ObjectDictionary,
    ) -> Result<(), (Address, AbortCode)> {
        let data = u64::from_le_bytes(data);
        let mut position = 0;
        let mut result = Ok(());
        for entry in self.entries() {
            let bits = u32::from(entry.bits());
            let raw = data.checked_shr(position).unwrap_or(0) & mask(bits);
            position += bits;
            let taken = take(od, entry.at(), raw);
            result = result.and(taken.map_err(|code| (entry.at(), code)));
        }
        result
    }
}

fn take(od: &mut impl ObjectDictionary, at: Address, raw: u64) -> Result<(), AbortCode> {
    let entry = od.entry(at)?;
    let value = Value::new(entry.data_type, raw as i64);
    entry.in_range(value)?;
    od.set(at, value)
}

fn mask(bits: u32) -> u64 {
    u64::MAX
        .checked_shr(64u32.saturating_sub(bits))
        .unwrap_or(0)
}
