//! The ELF image: what is loaded where, and the symbols that are needed.

use object::read::elf::{ElfFile32, ProgramHeader as _};
use object::{Endianness, Object as _, ObjectSection as _, ObjectSymbol as _, SectionFlags, elf};
use std::collections::BTreeMap;

use super::memory;

/// Why a board could not be built.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BoardError {
    /// The file is not a 32-bit ELF image.
    #[error("not an ELF image for the board ({0}): build it with `cargo xtask build`")]
    Elf(String),
    /// A segment lies outside the flash.
    #[error(
        "a segment of {len} bytes is to be loaded at 0x{address:08x}, outside the flash: check memory.x"
    )]
    Segment {
        /// Physical address.
        address: u32,
        /// Bytes in the file.
        len: usize,
    },
    /// The image has nothing at the start of the flash.
    #[error("the image has no vector table at 0x08000000: was it linked with link.x?")]
    NoVectorTable,
    /// The emulator refused the memory map.
    #[error("the emulator's memory map cannot be built: {0}")]
    Map(String),
}

/// Sizes of an image.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ImageSize {
    /// Bytes that lie in flash.
    pub flash_bytes: u32,
    /// Bytes of RAM allocated statically, without the stack.
    pub ram_bytes: u32,
}

/// What is taken from the ELF file.
#[derive(Debug, Clone)]
pub(super) struct Image {
    pub(super) segments: Vec<(u32, Vec<u8>)>,
    pub(super) size: ImageSize,
    /// Address of `_SEGGER_RTT`.
    pub(super) rtt: Option<u32>,
    /// Functions by address, with their size.
    functions: BTreeMap<u32, (u32, String)>,
    /// End addresses of the sections in RAM.
    ram_ends: Vec<u32>,
}

impl Image {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, BoardError> {
        let words = |error: object::Error| BoardError::Elf(error.to_string());
        let file = ElfFile32::<Endianness>::parse(bytes).map_err(words)?;
        let endian = file.endian();
        let mut image = Self {
            segments: Vec::new(),
            size: ImageSize::default(),
            rtt: None,
            functions: BTreeMap::new(),
            ram_ends: Vec::new(),
        };
        for header in file.elf_program_headers() {
            if header.p_type(endian) != elf::PT_LOAD {
                continue;
            }
            let data = header
                .data(endian, bytes)
                .map_err(|()| BoardError::Elf("a segment lies outside the file".to_string()))?;
            if data.is_empty() {
                continue;
            }
            let address = header.p_paddr(endian);
            let end = u64::from(address) + data.len() as u64;
            if !memory::in_flash(address) || end > memory::FLASH_END {
                return Err(BoardError::Segment {
                    address,
                    len: data.len(),
                });
            }
            image.size.flash_bytes += data.len() as u32;
            image.segments.push((address, data.to_vec()));
        }
        if !image
            .segments
            .iter()
            .any(|(at, _)| *at == memory::FLASH_BASE)
        {
            return Err(BoardError::NoVectorTable);
        }
        image.take_sections(&file);
        image.take_symbols(&file);
        Ok(image)
    }

    /// An image of nothing but segments.
    #[cfg(test)]
    pub(super) fn bare(segments: Vec<(u32, Vec<u8>)>, size: ImageSize) -> Self {
        Self {
            segments,
            size,
            rtt: None,
            functions: BTreeMap::new(),
            ram_ends: Vec::new(),
        }
    }

    fn take_sections(&mut self, file: &ElfFile32<'_, Endianness>) {
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags } = section.flags() else {
                continue;
            };
            let address = section.address() as u32;
            let size = section.size() as u32;
            if sh_flags & u64::from(elf::SHF_ALLOC) != 0 && size > 0 && memory::in_ram(address) {
                self.size.ram_bytes += size;
                self.ram_ends.push(address + size);
            }
        }
    }

    fn take_symbols(&mut self, file: &ElfFile32<'_, Endianness>) {
        const THUMB: u32 = 1;
        for symbol in file.symbols() {
            let Ok(name) = symbol.name() else { continue };
            let address = symbol.address() as u32;
            if name == "_SEGGER_RTT" {
                self.rtt = Some(address);
            }
            if symbol.kind() == object::SymbolKind::Text && symbol.size() > 0 {
                let entry = (symbol.size() as u32, name.to_string());
                self.functions.insert(address & !THUMB, entry);
            }
        }
    }

    /// The function that an address lies in, with the offset.
    pub(super) fn function_at(&self, address: u32) -> Option<String> {
        let (start, (size, name)) = self.functions.range(..=address).next_back()?;
        let offset = address - start;
        (offset < *size).then(|| format!("{name}+0x{offset:x}"))
    }

    /// The lowest address that the stack whose top is `top` may grow down to.
    pub(super) fn stack_bottom(&self, top: u32) -> u32 {
        self.ram_ends
            .iter()
            .copied()
            .filter(|&end| end <= top && memory::same_ram(end, top))
            .max()
            .unwrap_or_else(|| memory::ram_base(top))
    }
}
