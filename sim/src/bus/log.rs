//! Bus records as a log that can-utils and python-can read: the format of
//! `candump -L`.
//!
//! A line is stamped with the frame's start in microseconds since power-on.
//! An error frame is written as SocketCAN's M_CAN driver reports it to a
//! candump that asked for errors: identifier with the error flag, the class
//! "protocol violation, bus error", and kind and place in the data.

use super::types::{RecordKind, WireError, WireRecord};
use crate::frame::{MAX_DATA, WireFrame, WireId};
use crate::time::{PS_PER_S, PS_PER_US};
use std::io::{self, Write};

// linux/can.h and linux/can/error.h.
const CAN_ERR_FLAG: u32 = 0x2000_0000;
const CAN_ERR_PROT: u32 = 0x0000_0008;
const CAN_ERR_BUSERROR: u32 = 0x0000_0080;
const CAN_ERR_PROT_FORM: u8 = 0x02;
const CAN_ERR_PROT_STUFF: u8 = 0x04;
const CAN_ERR_PROT_BIT0: u8 = 0x08;
const CAN_ERR_PROT_BIT1: u8 = 0x10;
const CAN_ERR_PROT_LOC_CRC_SEQ: u8 = 0x08;
const CAN_ERR_PROT_LOC_ACK: u8 = 0x19;
/// Where in the data an error frame has its kind, and its place.
const KIND_BYTE: usize = 2;
const PLACE_BYTE: usize = 3;

/// Writes `records` as log lines of the interface `channel`, e.g. "can0".
///
/// # Errors
/// What the writer says.
pub fn write_candump<'a>(
    out: &mut impl Write,
    channel: &str,
    records: impl IntoIterator<Item = &'a WireRecord>,
) -> io::Result<()> {
    for record in records {
        let sof = record.sof.as_ps();
        let us = sof % PS_PER_S / PS_PER_US;
        write!(out, "({:010}.{us:06}) {channel} ", sof / PS_PER_S)?;
        match &record.kind {
            RecordKind::Frame(frame) => write_frame(out, frame)?,
            RecordKind::ErrorFrame { error, .. } => write_error(out, *error)?,
        }
        writeln!(out)?;
    }
    Ok(())
}

fn write_frame(out: &mut impl Write, frame: &WireFrame) -> io::Result<()> {
    match frame.id {
        WireId::Standard(id) => write!(out, "{id:03X}#")?,
        WireId::Extended(id) => write!(out, "{id:08X}#")?,
    }
    if !frame.rtr {
        return write_bytes(out, frame.payload());
    }
    write!(out, "R")?;
    match usize::from(frame.dlc).min(MAX_DATA) {
        0 => Ok(()),
        dlc => write!(out, "{dlc}"),
    }
}

fn write_error(out: &mut impl Write, error: WireError) -> io::Result<()> {
    let mut data = [0; MAX_DATA];
    match error {
        WireError::Form => data[KIND_BYTE] = CAN_ERR_PROT_FORM,
        WireError::Stuff => data[KIND_BYTE] = CAN_ERR_PROT_STUFF,
        WireError::Bit0 => data[KIND_BYTE] = CAN_ERR_PROT_BIT0,
        WireError::Bit1 => data[KIND_BYTE] = CAN_ERR_PROT_BIT1,
        WireError::Crc => data[PLACE_BYTE] = CAN_ERR_PROT_LOC_CRC_SEQ,
        WireError::Ack => data[PLACE_BYTE] = CAN_ERR_PROT_LOC_ACK,
    }
    let id = CAN_ERR_FLAG | CAN_ERR_PROT | CAN_ERR_BUSERROR;
    write!(out, "{id:08X}#")?;
    write_bytes(out, &data)
}

fn write_bytes(out: &mut impl Write, bytes: &[u8]) -> io::Result<()> {
    bytes.iter().try_for_each(|byte| write!(out, "{byte:02X}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Time;

    fn line(at: Time, kind: RecordKind) -> String {
        let record = WireRecord {
            sof: at,
            end: at,
            bits: 0,
            transmitters: Vec::new(),
            kind,
        };
        let mut out = Vec::new();
        write_candump(&mut out, "can0", [&record]).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn golden_lines() {
        let at = Time::from_s(12) + Time::from_us(34) + Time::from_ns(999);
        let frame = |frame| line(at, RecordKind::Frame(frame));
        assert_eq!(
            frame(WireFrame::standard(0x080, &[])),
            "(0000000012.000034) can0 080#\n"
        );
        assert_eq!(
            frame(WireFrame::standard(
                0x601,
                &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0xFF]
            )),
            "(0000000012.000034) can0 601#40181001000000FF\n"
        );
        assert_eq!(
            frame(WireFrame::remote(WireId::Standard(0x701), 0)),
            "(0000000012.000034) can0 701#R\n"
        );
        assert_eq!(
            frame(WireFrame::remote(WireId::Standard(0x701), 1)),
            "(0000000012.000034) can0 701#R1\n"
        );
        assert_eq!(
            frame(WireFrame::extended(0x123, &[0xAB])),
            "(0000000012.000034) can0 00000123#AB\n"
        );
    }

    #[test]
    fn golden_error_lines() {
        let error = |error| line(Time::ZERO, RecordKind::ErrorFrame { frame: None, error });
        assert_eq!(
            error(WireError::Stuff),
            "(0000000000.000000) can0 20000088#0000040000000000\n"
        );
        assert_eq!(
            error(WireError::Ack),
            "(0000000000.000000) can0 20000088#0000001900000000\n"
        );
    }
}
