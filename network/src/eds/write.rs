//! An EDS as text, so that other tools can load it.

use std::fmt::Write;

use super::{Eds, Entry, ObjectKind};

/// Objects that every device has (CiA 301, 7.5.2).
const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];
/// Where the manufacturer's objects lie.
const MANUFACTURER: std::ops::Range<u16> = 0x2000..0x6000;
/// ObjectType (CiA 301, table 42).
const VAR: u8 = 7;
const ARRAY: u8 = 8;
const RECORD: u8 = 9;

pub(super) fn write(eds: &Eds) -> String {
    let mut out = String::new();
    // Writing into a string cannot fail.
    let _ = head(eds, &mut out).and_then(|()| lists(eds, &mut out));
    let _ = objects(eds, &mut out);
    out
}

fn head(eds: &Eds, out: &mut String) -> std::fmt::Result {
    let device = &eds.device;
    writeln!(out, "[FileInfo]")?;
    writeln!(out, "FileName={}", eds.file)?;
    writeln!(out, "FileVersion=1\nFileRevision=0\nEDSVersion=4.0")?;
    writeln!(out, "Description={}\n", device.product_name)?;
    writeln!(out, "[DeviceInfo]")?;
    writeln!(out, "VendorName={}", device.vendor_name)?;
    writeln!(out, "VendorNumber=0x{:08X}", device.vendor.unwrap_or(0))?;
    writeln!(out, "ProductName={}", device.product_name)?;
    writeln!(out, "ProductNumber=0x{:08X}", device.product.unwrap_or(0))?;
    writeln!(out, "RevisionNumber=0x{:08X}", device.revision.unwrap_or(0))?;
    for (rate, offered) in &device.bit_rates {
        writeln!(out, "BaudRate_{rate}={}", u8::from(*offered))?;
    }
    let count = |first: u16, last: u16| eds.objects.range(first..=last).count();
    writeln!(out, "Granularity=8")?;
    writeln!(out, "NrOfRXPDO={}", count(0x1400, 0x15FF))?;
    writeln!(out, "NrOfTXPDO={}", count(0x1800, 0x19FF))?;
    writeln!(out, "LSS_Supported={}\n", u8::from(device.lss))?;
    writeln!(out, "[DummyUsage]")?;
    for index in 1..=7 {
        let used = u8::from(eds.dummies.contains(&index));
        writeln!(out, "Dummy{index:04X}={used}")?;
    }
    writeln!(out)
}

fn lists(eds: &Eds, out: &mut String) -> std::fmt::Result {
    let of = |list: &'static str, wanted: fn(u16) -> bool| {
        let indices: Vec<u16> = eds.objects.keys().copied().filter(|i| wanted(*i)).collect();
        (list, indices)
    };
    for (list, indices) in [
        of("MandatoryObjects", |i| MANDATORY.contains(&i)),
        of("OptionalObjects", |i| {
            !MANDATORY.contains(&i) && !MANUFACTURER.contains(&i)
        }),
        of("ManufacturerObjects", |i| MANUFACTURER.contains(&i)),
    ] {
        writeln!(out, "[{list}]\nSupportedObjects={}", indices.len())?;
        for (number, index) in (1..).zip(indices) {
            writeln!(out, "{number}=0x{index:04X}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn objects(eds: &Eds, out: &mut String) -> std::fmt::Result {
    for (index, object) in &eds.objects {
        writeln!(out, "[{index:04X}]\nParameterName={}", object.name)?;
        let object_type = match object.kind {
            ObjectKind::Variable => VAR,
            ObjectKind::Array => ARRAY,
            ObjectKind::Record => RECORD,
        };
        writeln!(out, "ObjectType=0x{object_type:X}")?;
        if object.kind == ObjectKind::Variable {
            if let Some(entry) = object.entries.get(&0) {
                keys(entry, out)?;
            }
            continue;
        }
        writeln!(out, "SubNumber={}\n", object.entries.len())?;
        for (sub, entry) in &object.entries {
            writeln!(out, "[{index:04X}sub{sub:X}]")?;
            writeln!(out, "ParameterName={}", entry.name)?;
            writeln!(out, "ObjectType=0x{VAR:X}")?;
            keys(entry, out)?;
        }
    }
    Ok(())
}

fn keys(entry: &Entry, out: &mut String) -> std::fmt::Result {
    writeln!(out, "DataType=0x{:04X}", entry.data_type.code())?;
    writeln!(out, "AccessType={}", entry.access.word())?;
    for (key, limit) in [("LowLimit", entry.low), ("HighLimit", entry.high)] {
        if let Some(limit) = limit {
            writeln!(out, "{key}={}", limit.value)?;
        }
    }
    if !entry.default_text.is_empty() {
        writeln!(out, "DefaultValue={}", entry.default_text)?;
    }
    writeln!(out, "PDOMapping={}\n", u8::from(entry.mappable))
}
