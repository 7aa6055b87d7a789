//! RTT: reads the program's up-buffer as a debug probe does.

use super::memory::Memory;

const ID: &[u8; 10] = b"SEGGER RTT";
/// Offsets within the control block: header, then up-channel 0.
const MAX_UP_CHANNELS: u32 = 16;
const BUFFER: u32 = 28;
const SIZE: u32 = 32;
const WRITE: u32 = 36;
const READ: u32 = 40;

/// Moves what up-channel 0 of the control block at `block` holds to `out` and
/// sets the read position, without the program taking part.
pub(super) fn drain(memory: &Memory, block: u32, out: &mut Vec<u8>) {
    let word = |offset: u32| memory.word(block + offset);
    let (Some(write), Some(read)) = (word(WRITE), word(READ)) else {
        return;
    };
    if write == read {
        return;
    }
    let mut id = [0; ID.len()];
    if !memory.read(block, &mut id) || &id != ID || word(MAX_UP_CHANNELS) == Some(0) {
        return;
    }
    let (Some(buffer), Some(size)) = (word(BUFFER), word(SIZE)) else {
        return;
    };
    if write >= size || read >= size {
        return;
    }
    let mut take = |from: u32, to: u32| {
        let start = out.len();
        out.resize(start + (to - from) as usize, 0);
        if !memory.read(buffer + from, &mut out[start..]) {
            out.truncate(start);
        }
    };
    if read < write {
        take(read, write);
    } else {
        take(read, size);
        take(0, write);
    }
    memory.poke(block + READ, write);
}
