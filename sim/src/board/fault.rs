//! A program that has come to a bad end: what happened, in words.

use std::fmt;

use rsemu::cpu::arm::v7m::{ArmV7m, Regs};

use super::image::Image;
use super::memory::Memory;
use crate::time::Time;

/// What became of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FaultKind {
    /// A HardFault was taken: a panic ends here too (UDF instruction).
    HardFault,
    /// A fault within the fault handler: the core stands still.
    LockUp,
}

/// A fault, with what is needed to find its cause.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FaultReport {
    /// When.
    pub at: Time,
    /// What.
    pub kind: FaultKind,
    /// The instruction at fault.
    pub pc: u32,
    /// Its return address.
    pub lr: u32,
    /// Configurable fault status register.
    pub cfsr: u32,
    /// HardFault status register.
    pub hfsr: u32,
    /// The address of a refused access, if `cfsr` says that it is valid.
    pub address: Option<u32>,
    /// Function and offset of `pc` and `lr`, where the ELF file names them.
    pub pc_function: Option<String>,
    /// The same of `lr`.
    pub lr_function: Option<String>,
}

/// Bits of CFSR and HFSR with their meaning.
const CAUSES: [(u32, &str); 12] = [
    (1 << 0, "instruction fetch that the MPU forbids"),
    (1 << 1, "data access that the MPU forbids"),
    (1 << 8, "instruction fetch from where nothing is"),
    (
        1 << 9,
        "access to where nothing is (a stack overflow ends below the SRAM)",
    ),
    (1 << 10, "imprecise access to where nothing is"),
    (1 << 12, "stacking for an exception failed (stack overflow)"),
    (1 << 16, "undefined instruction (a panic ends in UDF)"),
    (1 << 17, "jump to an address without the Thumb bit"),
    (1 << 18, "invalid exception return"),
    (1 << 19, "floating-point instruction while the FPU is off"),
    (1 << 24, "unaligned access"),
    (1 << 25, "division by zero"),
];
const HFSR_DEBUG: u32 = 1 << 31;
const BFAR_VALID: u32 = 1 << 15;
const MMAR_VALID: u32 = 1 << 7;

impl FaultReport {
    /// Looks at a core that has just entered the HardFault handler, or locked
    /// up.
    pub(super) fn of(
        core: &ArmV7m,
        regs: &Regs,
        memory: &Memory,
        image: &Image,
        at: Time,
        kind: FaultKind,
    ) -> Self {
        const USES_PSP: u32 = 1 << 2;
        const STACKED_LR: u32 = 20;
        const STACKED_PC: u32 = 24;
        let frame = if regs.r[14] & USES_PSP != 0 {
            regs.psp
        } else {
            regs.msp
        };
        let stacked = |offset: u32| memory.word(frame.wrapping_add(offset)).unwrap_or(0);
        let (pc, lr) = match kind {
            FaultKind::HardFault => (stacked(STACKED_PC), stacked(STACKED_LR)),
            FaultKind::LockUp => (regs.r[15], regs.r[14]),
        };
        let (cfsr, hfsr, bfar, mmfar) =
            core.with_sys(|sys| (sys.cfsr, sys.hfsr, sys.bfar, sys.mmfar));
        let address = if cfsr & BFAR_VALID != 0 {
            Some(bfar)
        } else {
            (cfsr & MMAR_VALID != 0).then_some(mmfar)
        };
        Self {
            at,
            kind,
            pc,
            lr,
            cfsr,
            hfsr,
            address,
            pc_function: image.function_at(pc),
            lr_function: image.function_at(lr & !1),
        }
    }
}

impl fmt::Display for FaultReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.kind {
            FaultKind::HardFault => "HardFault",
            FaultKind::LockUp => "lock-up (a fault within the fault handler)",
        })?;
        write!(f, " at {} s: pc 0x{:08x}", self.at, self.pc)?;
        if let Some(name) = &self.pc_function {
            write!(f, " in {name}")?;
        }
        write!(f, ", lr 0x{:08x}", self.lr)?;
        if let Some(name) = &self.lr_function {
            write!(f, " in {name}")?;
        }
        for (bit, words) in CAUSES {
            if self.cfsr & bit != 0 {
                write!(f, "; {words}")?;
            }
        }
        if self.hfsr & HFSR_DEBUG != 0 {
            f.write_str("; breakpoint without a debugger")?;
        }
        if let Some(address) = self.address {
            write!(f, "; address 0x{address:08x}")?;
        }
        Ok(())
    }
}
