//! Flash, SRAM and CCM, and the space that the core sees.

use rsemu::core::space::{
    AccessConstraints, AddressSpace, DispatchPolicy, Mapping, MappingId, MemAttrs, MemOps,
    MemResult, Perms, RamStore, Region,
};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use super::flash::{BANK_BYTES, FLASH_BYTES};
use super::image::BoardError;
use super::soc::{Access, Soc};

pub(super) const FLASH_BASE: u32 = 0x0800_0000;
pub(super) const FLASH_END: u64 = FLASH_BASE as u64 + FLASH_BYTES as u64;
/// SRAM1, SRAM2 and, at its end, the alias of CCM.
const SRAM_BASE: u32 = 0x2000_0000;
const SRAM_BYTES: u64 = 128 * 1024;
const CCM_BASE: u32 = 0x1000_0000;
const CCM_BYTES: u64 = 32 * 1024;
/// Unique identifier, package and flash size.
const SIGNATURE_BASE: u32 = 0x1FFF_7000;
const SIGNATURE_BYTES: u64 = 0x1000;
/// Where the peripherals are: base and length of each window.
const WINDOWS: [(&str, u32, u64); 4] = [
    ("apb and ahb1", 0x4000_0000, 0x3_0000),
    ("ahb2 gpio", 0x4800_0000, 0x2000),
    ("ahb2", 0x5000_0000, 0x6_1000),
    ("dbgmcu", 0xE004_2000, 0x400),
];
/// What RAM holds after power-on: no plausible pointer, count or flag.
const POWER_ON_BYTE: u8 = 0xA5;
pub(super) const POWER_ON_WORD: u32 = u32::from_le_bytes([POWER_ON_BYTE; 4]);

pub(super) const fn in_flash(address: u32) -> bool {
    address >= FLASH_BASE && (address as u64) < FLASH_END
}

pub(super) const fn in_ram(address: u32) -> bool {
    let address = address as u64;
    (address >= SRAM_BASE as u64 && address < SRAM_BASE as u64 + SRAM_BYTES)
        || (address >= CCM_BASE as u64 && address < CCM_BASE as u64 + CCM_BYTES)
}

/// The base of the RAM whose end, or a place in it, is `address`.
pub(super) const fn ram_base(address: u32) -> u32 {
    if address > SRAM_BASE {
        SRAM_BASE
    } else {
        CCM_BASE
    }
}

pub(super) const fn same_ram(a: u32, b: u32) -> bool {
    ram_base(a) == ram_base(b)
}

/// What the core's thread of control shares with the peripherals while an
/// instruction runs.
#[derive(Debug, Default)]
pub(super) struct Shared {
    pub(super) cycle: AtomicU64,
    pub(super) pc: AtomicU32,
    /// An access concerned interrupts, deadlines or the bus.
    pub(super) dirty: AtomicBool,
    /// For how many cycles the instruction's accesses to the flash wait.
    pub(super) stall: AtomicU64,
}

impl Shared {
    /// The access of the instruction that runs. A store reaches the peripheral
    /// in its second cycle.
    fn access(&self) -> Access {
        const INTO_THE_INSTRUCTION: u64 = 2;
        Access {
            cycle: self.cycle.load(Ordering::Relaxed) + INTO_THE_INSTRUCTION,
            pc: self.pc.load(Ordering::Relaxed),
        }
    }
}

/// A window of peripheral registers.
#[derive(Debug)]
struct Window {
    base: u32,
    soc: Arc<Mutex<Soc>>,
    shared: Arc<Shared>,
}

/// Locks the peripherals. A panic elsewhere leaves them as they are.
pub(super) fn lock(soc: &Mutex<Soc>) -> MutexGuard<'_, Soc> {
    soc.lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Window {
    fn access(&self) -> Access {
        self.shared.access()
    }
}

impl MemOps for Window {
    fn read(&self, offset: u64, dst: &mut [u8], _attrs: MemAttrs) -> MemResult {
        let address = self.base + offset as u32;
        let access = self.access();
        let mut soc = lock(&self.soc);
        if dst.len() != 4 {
            soc.check_width(address, dst.len(), access);
        }
        let word = soc.read(address & !3, access).to_le_bytes();
        for (k, byte) in dst.iter_mut().enumerate() {
            *byte = word[(address as usize + k) % 4];
        }
        Ok(())
    }

    fn write(&self, offset: u64, src: &[u8], _attrs: MemAttrs) -> MemResult {
        let address = self.base + offset as u32;
        let access = self.access();
        let mut soc = lock(&self.soc);
        let mut word = [0; 4];
        if src.len() != 4 {
            // A narrow write changes its bytes of the word.
            soc.check_width(address, src.len(), access);
            word = soc.read(address & !3, access).to_le_bytes();
        }
        for (k, byte) in src.iter().enumerate() {
            word[(address as usize + k) % 4] = *byte;
        }
        if soc.write(address & !3, u32::from_le_bytes(word), access) {
            self.shared.dirty.store(true, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// The flash behind its interface: what is not plain reading of bank 1.
#[derive(Debug)]
struct FlashWindow {
    soc: Arc<Mutex<Soc>>,
    shared: Arc<Shared>,
}

impl MemOps for FlashWindow {
    fn read(&self, offset: u64, dst: &mut [u8], _attrs: MemAttrs) -> MemResult {
        let access = self.shared.access();
        let mut soc = lock(&self.soc);
        let stall = soc.read_flash(offset as u32, dst, access);
        // Accesses of one instruction wait for the same operation.
        let stall = stall.max(self.shared.stall.load(Ordering::Relaxed));
        self.shared.stall.store(stall, Ordering::Relaxed);
        if soc.flash().has_nmi() {
            self.shared.dirty.store(true, Ordering::Relaxed);
        }
        Ok(())
    }

    fn write(&self, offset: u64, src: &[u8], _attrs: MemAttrs) -> MemResult {
        let access = self.shared.access();
        lock(&self.soc).write_flash(offset as u32, src, access);
        self.shared.dirty.store(true, Ordering::Relaxed);
        Ok(())
    }

    fn constraints(&self) -> AccessConstraints {
        AccessConstraints::ANY
    }
}

/// The memories.
#[derive(Debug)]
pub(super) struct Memory {
    flash: Arc<RamStore>,
    sram: Arc<RamStore>,
    space: Arc<AddressSpace>,
    /// Plain reading of bank 1 and whether it is allowed.
    bank1: (MappingId, bool),
}

impl Memory {
    /// Builds the map, with RAM as after power-on.
    pub(super) fn new(soc: &Arc<Mutex<Soc>>, shared: &Arc<Shared>) -> Result<Self, BoardError> {
        const PAGE_BITS: u32 = 12;
        /// The table covers everything up to the last peripheral window.
        const TABLE_END: u64 = 0x5010_0000;
        let refused = |error: rsemu::core::Error| BoardError::Map(error.to_string());
        let flash = lock(soc).flash().store();
        let sram = Arc::new(RamStore::new(SRAM_BYTES));
        let space =
            AddressSpace::new("STM32G474", u32::BITS).with_dispatch(DispatchPolicy::Dense {
                page_bits: PAGE_BITS,
                cover: TABLE_END,
            });
        let signature = Arc::new(RamStore::new(SIGNATURE_BYTES));
        fill_signature(&signature).map_err(|error| BoardError::Map(format!("{error:?}")))?;
        let bank1 = {
            let mut map = space.topology();
            let window = FlashWindow {
                soc: Arc::clone(soc),
                shared: Arc::clone(shared),
            };
            let window = Region::io("flash", u64::from(FLASH_BYTES), Arc::new(window));
            map.map(window, u64::from(FLASH_BASE)).map_err(refused)?;
            // Before it, for reading only: the program, as fast as can be.
            let bank1 = Arc::new(Region::ram("flash", Arc::clone(&flash)));
            let bank1 =
                Region::alias("bank 1", bank1, 0, u64::from(BANK_BYTES)).map_err(refused)?;
            let bank1 = Mapping::new(bank1, u64::from(FLASH_BASE))
                .with_perms(Perms::RX)
                .with_priority(1);
            let bank1 = map.map_with(bank1).map_err(refused)?;
            let signature = Region::ram("signature", signature);
            map.map_with_perms(signature, u64::from(SIGNATURE_BASE), Perms::RX)
                .map_err(refused)?;
            let sram = Arc::new(Region::ram("sram", Arc::clone(&sram)));
            let ccm = Region::alias("ccm", Arc::clone(&sram), SRAM_BYTES - CCM_BYTES, CCM_BYTES)
                .map_err(refused)?;
            map.map(sram, u64::from(SRAM_BASE)).map_err(refused)?;
            map.map(ccm, u64::from(CCM_BASE)).map_err(refused)?;
            for (name, base, len) in WINDOWS {
                let window = Window {
                    base,
                    soc: Arc::clone(soc),
                    shared: Arc::clone(shared),
                };
                map.map(Region::io(name, len, Arc::new(window)), u64::from(base))
                    .map_err(refused)?;
            }
            bank1
        };
        let memory = Self {
            flash,
            sram,
            space: Arc::new(space),
            bank1: (bank1, true),
        };
        memory.power_on();
        Ok(memory)
    }

    /// What the core sees.
    pub(super) fn space(&self) -> Arc<AddressSpace> {
        Arc::clone(&self.space)
    }

    /// Lets bank 1 be read directly, or only through its interface.
    pub(super) fn set_bank1_plain(&mut self, plain: bool) {
        if self.bank1.1 != plain {
            self.bank1.1 = plain;
            let perms = if plain { Perms::RX } else { Perms::NONE };
            let done = self.space.topology().reprotect(self.bank1.0, perms);
            debug_assert!(done.is_ok(), "the mapping stays for good");
        }
    }

    /// RAM loses what it held.
    pub(super) fn power_on(&self) {
        // The range is the store's own: it cannot be refused.
        let _ = self.sram.fill(0, SRAM_BYTES, POWER_ON_BYTE);
    }

    /// Puts other code into the flash, as no program could; false if it does not
    /// fit.
    pub(super) fn patch(&self, address: u32, bytes: &[u8]) -> bool {
        let offset = u64::from(address.wrapping_sub(FLASH_BASE));
        self.flash.write_at(offset, bytes).is_ok()
    }

    /// Reads bytes of flash or RAM; false where there is neither.
    pub(super) fn read(&self, address: u32, bytes: &mut [u8]) -> bool {
        let (store, base) = if in_flash(address) {
            (&self.flash, FLASH_BASE)
        } else if address >= SRAM_BASE {
            (&self.sram, SRAM_BASE)
        } else if address >= CCM_BASE {
            let offset = (SRAM_BYTES - CCM_BYTES) as u32;
            return self
                .sram
                .read_at(u64::from(address - CCM_BASE + offset), bytes)
                .is_ok();
        } else {
            return false;
        };
        store.read_at(u64::from(address - base), bytes).is_ok()
    }

    /// Reads a word of flash or RAM.
    pub(super) fn word(&self, address: u32) -> Option<u32> {
        let mut bytes = [0; 4];
        self.read(address, &mut bytes)
            .then(|| u32::from_le_bytes(bytes))
    }

    /// Writes a word of SRAM, as a debug probe does.
    pub(super) fn poke(&self, address: u32, value: u32) -> bool {
        address >= SRAM_BASE
            && self
                .sram
                .write_at(u64::from(address - SRAM_BASE), &value.to_le_bytes())
                .is_ok()
    }
}

/// UID, package (LQFP64) and flash size in KiB.
fn fill_signature(store: &RamStore) -> MemResult {
    const UID: u64 = 0x590;
    const PACKAGE: u64 = 0x500;
    const FLASH_SIZE: u64 = 0x5E0;
    store.fill(0, SIGNATURE_BYTES, 0xFF)?;
    store.write_at(UID, b"\x2A\x00\x3B\x00CANMASTR")?;
    store.write_at(PACKAGE, &0u32.to_le_bytes())?;
    store.write_at(FLASH_SIZE, &((FLASH_BYTES / 1024) as u16).to_le_bytes())
}
