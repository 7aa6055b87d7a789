//! A program as bytes; `docs/motion.md` has the format. Little-endian.

use super::{Action, Move, Path, Program, Step, VERSION};

const MOVE: u8 = 1;
const WAIT: u8 = 2;
const LOOP: u8 = 3;
const END_LOOP: u8 = 4;
const PATH: u8 = 5;
const HOME: u8 = 6;
const MODE: u8 = 7;

const RELATIVE: u8 = 1;
const FLYING: u8 = 2;
const SHARED: u8 = 4;

/// The set of a part stands above its velocity.
const SET: u32 = 24;

impl Program {
    /// Its bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut body = Vec::new();
        steps(&self.steps, &mut body);
        let mut bytes = vec![VERSION, self.axes as u8];
        bytes.extend((body.len() as u16).to_le_bytes());
        bytes.extend(self.cycle_us.to_le_bytes());
        bytes.extend(body);
        let sum = crc(&bytes);
        bytes.extend(sum.to_le_bytes());
        bytes
    }

    /// The line of a step, as the firmware counts them: from 1, in the order of the
    /// bytes.
    pub fn line_of(&self, step: u16) -> Option<u32> {
        fn lines(steps: &[Step], out: &mut Vec<u32>) {
            for step in steps {
                out.push(step.line);
                if let Action::Repeat { steps, .. } = &step.action {
                    lines(steps, out);
                    out.push(step.line);
                }
            }
        }
        let mut all = Vec::new();
        lines(&self.steps, &mut all);
        let line = all.get(usize::from(step).checked_sub(1)?);
        line.copied().filter(|line| *line != 0)
    }
}

fn steps(steps: &[Step], out: &mut Vec<u8>) {
    for step in steps {
        action(&step.action, out);
    }
}

fn head(kind: u8, flags: u8, axes: u32, value: u32, out: &mut Vec<u8>) {
    out.extend([kind, flags]);
    out.extend((axes as u16).to_le_bytes());
    out.extend(value.to_le_bytes());
}

fn action(action: &Action, out: &mut Vec<u8>) {
    match action {
        Action::Move(a_move) => moves(a_move, out),
        Action::Wait { cycles } => head(WAIT, 0, 0, *cycles, out),
        Action::Repeat { times, steps: all } => {
            head(LOOP, 0, 0, (*times).into(), out);
            steps(all, out);
            head(END_LOOP, 0, 0, 0, out);
        }
        Action::Path(a_path) => path(a_path, out),
        Action::Home { axes, limit } => head(HOME, 0, *axes, *limit, out),
        Action::Mode { axes, mode } => head(MODE, *mode, *axes, 0, out),
    }
}

fn flags(relative: bool, flying: bool) -> u8 {
    (u8::from(relative) * RELATIVE) | (u8::from(flying) * FLYING)
}

/// The set of axes.
fn set(axes: impl Iterator<Item = usize>) -> u32 {
    axes.fold(0, |set, axis| set | 1 << axis)
}

fn moves(a_move: &Move, out: &mut Vec<u8>) {
    let axes = set(a_move.parts.iter().map(|part| part.axis));
    let flags = flags(a_move.relative, a_move.flying);
    head(MOVE, flags, axes, a_move.jerk, out);
    for part in &a_move.parts {
        out.extend(part.target.to_le_bytes());
        let velocity = part.velocity | (u32::from(part.set) << SET);
        for number in [velocity, part.acceleration, part.deceleration] {
            out.extend(number.to_le_bytes());
        }
    }
}

fn path(path: &Path, out: &mut Vec<u8>) {
    let axes = set(path.members.iter().map(|member| member.axis));
    let flags = flags(path.relative, path.flying) | (u8::from(path.shared) * SHARED);
    let value = path.points.len() as u32 | (u32::from(path.periods) << u16::BITS);
    head(PATH, flags, axes, value, out);
    for member in &path.members {
        out.extend(member.amplitude.to_le_bytes());
        out.extend(member.begin.to_le_bytes());
    }
    for point in &path.points {
        out.extend(point.cycles.to_le_bytes());
        for (position, velocity) in &point.shapes {
            out.extend(position.to_le_bytes());
            out.extend(velocity.to_le_bytes());
        }
    }
}

/// CRC-16 as in SDO block transfer (CiA 301, 7.2.4.3.16).
fn crc(bytes: &[u8]) -> u16 {
    const POLYNOMIAL: u16 = 0x1021;
    bytes.iter().fold(0, |crc, byte| {
        (0..u8::BITS).fold(crc ^ (u16::from(*byte) << u8::BITS), |crc, _| {
            let shifted = crc << 1;
            if crc >> (u16::BITS - 1) == 1 {
                shifted ^ POLYNOMIAL
            } else {
                shifted
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of CiA 301, 7.2.4.3.16.
    #[test]
    fn checksum_of_the_digits() {
        assert_eq!(crc(b"123456789"), 0x31C3);
    }
}
