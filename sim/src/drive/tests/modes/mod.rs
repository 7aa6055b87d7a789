//! Every mode of operation, from the wire.

mod cyclic_position;
mod cyclic_velocity_torque;
mod homing;
mod limits;
mod profile_position;

use super::rig::{Rig, quick};
use crate::drive::DriveConfig;
use crate::drive::plant::PlantConfig;
use crate::drive::travel::Travel;

/// Bit 10 of the statusword.
const REACHED: u16 = 1 << 10;
/// Bit 11.
const LIMIT: u16 = 1 << 11;
/// Bit 12.
const BIT_12: u16 = 1 << 12;
/// Bit 13.
const BIT_13: u16 = 1 << 13;
/// Bit 15.
const REFERENCED: u16 = 1 << 15;

/// Node 1, its shaft at `position`.
fn at(position: f64) -> DriveConfig {
    with(Travel::default(), position)
}

/// Node 1 with ends and switches, its shaft at `position`.
fn with(travel: Travel, position: f64) -> DriveConfig {
    let config = quick(1);
    DriveConfig {
        plant: PlantConfig {
            start_position: position,
            travel,
            ..config.plant
        },
        ..config
    }
}

/// A drive whose RPDO `number` (from 0) carries 6040h and `entry` with SYNC,
/// enabled in `mode` while set values come every `period_ms`.
struct Cyclic {
    rig: Rig,
    id: u16,
    bytes: usize,
    period_ms: u64,
}

impl Cyclic {
    fn new(config: DriveConfig, mode: u8, entry: u32, period_ms: u64, first: i32) -> Cyclic {
        Cyclic::told(config, mode, entry, period_ms, period_ms, first)
    }

    /// The same, told in 60C2h that they come every `told_ms`.
    fn told(
        config: DriveConfig,
        mode: u8,
        entry: u32,
        period_ms: u64,
        told_ms: u64,
        first: i32,
    ) -> Cyclic {
        let mut rig = Rig::booted(config);
        rig.write32(0x1400, 1, 0x8000_0201);
        rig.write(0x1600, 0, &[0]).unwrap();
        rig.write32(0x1600, 1, 0x6040_0010);
        rig.write32(0x1600, 2, entry.into());
        rig.write(0x1600, 0, &[2]).unwrap();
        rig.write(0x1400, 2, &[1]).unwrap();
        rig.write32(0x1400, 1, 0x201);
        rig.write(0x60C2, 1, &[told_ms as u8]).unwrap();
        rig.write(0x6060, 0, &[mode]).unwrap();
        rig.nmt(0x01);
        let mut cyclic = Cyclic {
            rig,
            id: 0x201,
            bytes: (entry as usize & 0xFF) / 8,
            period_ms,
        };
        for word in [0x06, 0x07, 0x0F, 0x0F] {
            cyclic.send(word, first);
        }
        cyclic
    }

    /// One period.
    fn send(&mut self, controlword: u16, value: i32) {
        let mut data = controlword.to_le_bytes().to_vec();
        data.extend_from_slice(&value.to_le_bytes()[..self.bytes]);
        self.rig.send(self.id, &data);
        self.rig.send(0x080, &[]);
        self.rig.run_ms(self.period_ms);
    }

    fn set(&mut self, value: i32) {
        self.send(0x0F, value);
    }
}
