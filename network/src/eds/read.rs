//! From sections and keys to objects.

use std::collections::BTreeMap;

use super::ini::{Ini, Section, Value};
use super::{DeviceInfo, Eds, Entry, Number, Object, ObjectKind};
use crate::object::{Access, DataType};
use crate::problem::{Place, Problem, Problems};
use crate::source::Source;

pub(super) fn read(source: &Source) -> (Eds, Vec<Problem>) {
    let mut problems = Problems::default();
    let ini = Ini::read(source, &mut problems);
    let mut reader = Reader {
        source,
        ini: &ini,
        problems,
    };
    let eds = reader.eds();
    if eds.objects.is_empty() {
        reader.problems.error(
            &Place::file(source),
            source.name(),
            "there is no object in this file",
            "give the EDS or DCF of the device; its sections are named like [1000]",
        );
    }
    (eds, reader.problems.into_vec())
}

struct Reader<'a> {
    source: &'a Source,
    ini: &'a Ini,
    problems: Problems,
}

/// ObjectType codes (CiA 301, 7.4.3, table 42).
mod object_type {
    pub(super) const ARRAY: i128 = 8;
    pub(super) const RECORD: i128 = 9;
    pub(super) const DEFSTRUCT: i128 = 6;
    pub(super) const DOMAIN: i128 = 2;
}

/// The bit rates that `[DeviceInfo]` names, kbit/s.
const BIT_RATES: [u32; 8] = [10, 20, 50, 125, 250, 500, 800, 1000];
/// Simple types that may be dummies (CiA 301, 7.4.8.2).
const DUMMIES: std::ops::RangeInclusive<u16> = 0x0001..=0x0007;
/// Digits of an index.
const INDEX_DIGITS: usize = 4;
const HEX: u32 = 16;

impl<'a> Reader<'a> {
    fn eds(&mut self) -> Eds {
        let mut objects = BTreeMap::new();
        for (name, section) in &self.ini.sections {
            if name.len() != INDEX_DIGITS || !name.bytes().all(|b| b.is_ascii_hexdigit()) {
                continue;
            }
            if let Ok(index) = u16::from_str_radix(name, HEX) {
                objects.insert(index, self.object(index, section));
            }
        }
        self.announced(&objects);
        Eds {
            file: self.source.name().to_string(),
            device: self.device(),
            node_id: self.node_id(),
            dummies: DUMMIES
                .filter(|index| {
                    let key = format!("dummy{index:04x}");
                    self.find("dummyusage", &key)
                        .and_then(|value| Number::parse(&value.text))
                        .is_some_and(|number| number.value != 0)
                })
                .collect(),
            objects,
        }
    }

    fn find(&self, section: &str, key: &str) -> Option<&'a Value> {
        self.ini.sections.get(section)?.keys.get(key)
    }

    fn text(&self, section: &str, key: &str) -> String {
        self.find(section, key)
            .map_or_else(String::new, |value| value.text.clone())
    }

    /// A number; `None` if it is missing or empty, and told if it is none.
    fn number(&mut self, section: &Section, key: &str) -> Option<Number> {
        let value = section.keys.get(key)?;
        if value.text.is_empty() {
            return None;
        }
        let number = Number::parse(&value.text);
        if number.is_none() {
            self.problems.warning(
                &Place::line(self.source, value.line),
                &value.text,
                format!("{key} is not a number"),
                "write a decimal number, 0x and hexadecimal digits, or $NODEID+0x...; it is \
                 left out",
            );
        }
        number
    }

    fn device(&mut self) -> DeviceInfo {
        const SECTION: &str = "deviceinfo";
        let Some(section) = self.ini.sections.get(SECTION) else {
            return DeviceInfo::default();
        };
        let mut number = |key: &str| {
            let number = self.number(section, key)?;
            u32::try_from(number.value).ok()
        };
        DeviceInfo {
            vendor: number("vendornumber"),
            product: number("productnumber"),
            revision: number("revisionnumber"),
            lss: number("lss_supported") == Some(1),
            bit_rates: BIT_RATES
                .into_iter()
                .filter_map(|rate| Some((rate, number(&format!("baudrate_{rate}"))? != 0)))
                .collect(),
            vendor_name: self.text(SECTION, "vendorname"),
            product_name: self.text(SECTION, "productname"),
        }
    }

    /// The standard misspells the section; not every tool does.
    fn node_id(&mut self) -> Option<u8> {
        let sections = ["devicecomissioning", "devicecommissioning"];
        let section = sections
            .iter()
            .find_map(|name| self.ini.sections.get(*name))?;
        let number = self.number(section, "nodeid")?;
        u8::try_from(number.value).ok()
    }

    /// Objects that the lists announce and that have no section.
    fn announced(&mut self, objects: &BTreeMap<u16, Object>) {
        for list in ["mandatoryobjects", "optionalobjects", "manufacturerobjects"] {
            let Some(section) = self.ini.sections.get(list) else {
                continue;
            };
            for (key, value) in &section.keys {
                if key.parse::<u16>().is_err() {
                    continue;
                }
                let number = Number::parse(&value.text);
                let index = number.and_then(|number| u16::try_from(number.value).ok());
                if index.is_none_or(|index| !objects.contains_key(&index)) {
                    self.problems.warning(
                        &Place::line(self.source, value.line),
                        &value.text,
                        "this object is announced and has no section",
                        "add the section, or take the object off the list; it is left out",
                    );
                }
            }
        }
    }

    fn object(&mut self, index: u16, section: &Section) -> Object {
        let name = section
            .keys
            .get("parametername")
            .map_or_else(|| format!("{index:04X}h"), |value| value.text.clone());
        let subs = self.sub_sections(index);
        let compact = self.number(section, "compactsubobj").map_or(0, |n| n.value);
        let kind = match self.number(section, "objecttype").map(|n| n.value) {
            Some(object_type::ARRAY) => ObjectKind::Array,
            Some(object_type::RECORD | object_type::DEFSTRUCT) => ObjectKind::Record,
            None if !subs.is_empty() || compact > 0 => ObjectKind::Record,
            _ => ObjectKind::Variable,
        };
        let mut entries = BTreeMap::new();
        if compact > 0 {
            self.compact(index, section, &name, compact, &mut entries);
        }
        for (sub, section) in subs {
            if let Some(entry) = self.entry(section, &name) {
                entries.insert(sub, entry);
            }
        }
        if kind == ObjectKind::Variable
            && entries.is_empty()
            && let Some(entry) = self.entry(section, &name)
        {
            entries.insert(0, entry);
        }
        Object {
            name,
            kind,
            line: section.line,
            entries,
        }
    }

    /// `[1018sub1]` and so on, sub-index in hexadecimal.
    fn sub_sections(&self, index: u16) -> Vec<(u8, &'a Section)> {
        let prefix = format!("{index:04x}sub");
        self.ini
            .sections
            .range(prefix.clone()..)
            .take_while(|(name, _)| name.starts_with(&prefix))
            .filter_map(|(name, section)| {
                let digits = name.get(prefix.len()..)?;
                // A sign would be taken as well.
                let plain = digits.bytes().all(|b| b.is_ascii_hexdigit());
                let sub = u8::from_str_radix(digits, HEX).ok().filter(|_| plain)?;
                Some((sub, section))
            })
            .collect()
    }

    /// CompactSubObj: all sub-indices alike (CiA 306, 4.6.3.2.3).
    fn compact(
        &mut self,
        index: u16,
        section: &Section,
        name: &str,
        count: i128,
        entries: &mut BTreeMap<u8, Entry>,
    ) {
        const LAST: i128 = 254;
        let count = count.min(LAST) as u8;
        let Some(template) = self.entry(section, name) else {
            return;
        };
        let sub_0 = Entry {
            name: "Highest sub-index supported".to_string(),
            data_type: DataType::Unsigned(8),
            access: Access::ReadOnly,
            mappable: false,
            low: None,
            high: None,
            default: Some(Number::plain(i128::from(count))),
            default_text: count.to_string(),
            parameter: None,
            line: section.line,
        };
        entries.insert(0, sub_0);
        for sub in 1..=count {
            let key = sub.to_string();
            let own_name = self.find(&format!("{index:04x}name"), &key);
            let value = self.find(&format!("{index:04x}value"), &key);
            let mut entry = Entry {
                name: own_name.map_or_else(|| format!("{name}{sub}"), |v| v.text.clone()),
                ..template.clone()
            };
            if let Some(value) = value {
                entry.parameter = Number::parse(&value.text);
            }
            entries.insert(sub, entry);
        }
    }

    /// The keys that every entry has. `None` if it has no type: told.
    fn entry(&mut self, section: &Section, object: &str) -> Option<Entry> {
        let name = section
            .keys
            .get("parametername")
            .map_or_else(|| object.to_string(), |value| value.text.clone());
        let is_domain =
            self.number(section, "objecttype").map(|n| n.value) == Some(object_type::DOMAIN);
        let code = self.number(section, "datatype");
        let code = code.and_then(|number| u16::try_from(number.value).ok());
        let data_type = match code {
            Some(code) => DataType::from_code(code),
            None if is_domain => DataType::Domain,
            None => {
                self.problems.warning(
                    &Place::line(self.source, section.line),
                    &name,
                    "this entry has no DataType",
                    "add DataType=0x....; the entry is left out",
                );
                return None;
            }
        };
        let access = self.access(section, is_domain)?;
        let mappable = self
            .number(section, "pdomapping")
            .is_some_and(|n| n.value != 0);
        let default = section.keys.get("defaultvalue");
        let default_text = default.map_or_else(String::new, |value| value.text.clone());
        let is_number = data_type.range().is_some();
        let mut limit = |key| {
            if is_number {
                self.number(section, key)
            } else {
                None
            }
        };
        Some(Entry {
            low: limit("lowlimit"),
            high: limit("highlimit"),
            default: limit("defaultvalue"),
            parameter: limit("parametervalue"),
            name,
            data_type,
            access,
            mappable,
            default_text,
            line: section.line,
        })
    }

    fn access(&mut self, section: &Section, is_domain: bool) -> Option<Access> {
        match section.keys.get("accesstype") {
            // The standard's default of a domain.
            None if is_domain => Some(Access::ReadWrite),
            Some(value) if value.text.is_empty() && is_domain => Some(Access::ReadWrite),
            Some(value) => {
                let word = value.text.split(';').next().unwrap_or_default().trim();
                let access = Access::from_word(word);
                if access.is_none() {
                    self.problems.warning(
                        &Place::line(self.source, value.line),
                        &value.text,
                        "AccessType is none of ro, wo, rw, rwr, rww, const",
                        "write one of these; the entry is left out",
                    );
                }
                access
            }
            None => {
                self.problems.warning(
                    &Place::line(self.source, section.line),
                    "AccessType",
                    "this entry has no AccessType",
                    "add AccessType=ro, wo, rw, rwr, rww or const; the entry is left out",
                );
                None
            }
        }
    }
}
