//! Sections and keys of an EDS, each with its line.

use std::collections::BTreeMap;

use ini_core::{Item, Parser};

use crate::problem::{Place, Problems};
use crate::source::Source;

/// Key, value and line; section names and keys in lower case, as files of
/// different tools write them differently.
#[derive(Debug, Default)]
pub(super) struct Ini {
    pub(super) sections: BTreeMap<String, Section>,
}

#[derive(Debug, Default)]
pub(super) struct Section {
    /// The line of its heading.
    pub(super) line: u32,
    pub(super) keys: BTreeMap<String, Value>,
}

#[derive(Debug)]
pub(super) struct Value {
    pub(super) text: String,
    pub(super) line: u32,
}

impl Ini {
    pub(super) fn read(source: &Source, problems: &mut Problems) -> Ini {
        let mut ini = Ini::default();
        let mut current: Option<String> = None;
        let mut parser = Parser::new(source.text()).auto_trim(true);
        loop {
            let line = parser.line() + 1;
            let Some(item) = parser.next() else {
                break;
            };
            match item {
                // A heading with something behind it, or with blanks before it.
                Item::Error(raw) | Item::Property(raw, None) if heading(raw).is_some() => {
                    current = heading(raw).map(|name| ini.open(name, line, source, problems));
                }
                Item::Section(name) => {
                    current = Some(ini.open(name.trim(), line, source, problems));
                }
                Item::Property(key, Some(value)) => {
                    // A comment that does not start in the first column.
                    if key.starts_with([';', '#']) {
                        continue;
                    }
                    let section = current.as_ref().and_then(|name| ini.sections.get_mut(name));
                    let Some(section) = section else {
                        problems.warning(
                            &Place::line(source, line),
                            key,
                            "this key stands before the first section",
                            "remove it, or put it under its [section]",
                        );
                        continue;
                    };
                    let value = Value {
                        text: value.to_string(),
                        line,
                    };
                    let key = key.to_lowercase();
                    if let Some(before) = section.keys.insert(key.clone(), value) {
                        problems.warning(
                            &Place::line(source, line),
                            key,
                            format!("this key stands in line {} already", before.line),
                            "remove one of the two; the last one counts",
                        );
                    }
                }
                Item::Error(raw) | Item::Property(raw, None) => {
                    if !raw.starts_with([';', '#']) {
                        problems.warning(
                            &Place::line(source, line),
                            raw,
                            "this is neither a [section] nor key=value",
                            "remove the line; it is left out",
                        );
                    }
                }
                Item::Comment(_) | Item::Blank | Item::SectionEnd => {}
            }
        }
        ini
    }

    fn open(&mut self, name: &str, line: u32, source: &Source, problems: &mut Problems) -> String {
        let key = name.to_lowercase();
        match self.sections.get(&key) {
            Some(before) => problems.warning(
                &Place::line(source, line),
                format!("[{name}]"),
                format!("this section begins in line {} already", before.line),
                "remove one of the two; their keys are taken together",
            ),
            None => {
                let keys = BTreeMap::new();
                self.sections.insert(key.clone(), Section { line, keys });
            }
        }
        key
    }
}

/// The name in `  [name]   ; whatever`.
fn heading(line: &str) -> Option<&str> {
    let (name, rest) = line.trim().strip_prefix('[')?.split_once(']')?;
    let rest = rest.trim();
    (rest.is_empty() || rest.starts_with([';', '#'])).then(|| name.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Ini, usize) {
        let mut problems = Problems::default();
        let ini = Ini::read(&Source::new("f", text.as_bytes()), &mut problems);
        (ini, problems.into_vec().len())
    }

    #[test]
    fn every_kind_of_line_end_and_case() {
        for end in ["\n", "\r\n", "\r"] {
            let text = [
                "[FileInfo]",
                "",
                "; c",
                " FileName = A b ",
                "[1000]  ",
                "OBJECTTYPE=7",
            ];
            let (ini, complaints) = read(&text.join(end));
            assert_eq!(complaints, 0);
            let name = &ini.sections["fileinfo"].keys["filename"];
            assert_eq!((name.text.as_str(), name.line), ("A b", 4));
            assert_eq!(ini.sections["1000"].line, 5);
            assert_eq!(ini.sections["1000"].keys["objecttype"].text, "7");
        }
    }

    #[test]
    fn odd_headings_are_headings() {
        let (ini, complaints) = read("  [1000]\na=1\n[1001] ; status\nb=2\n");
        assert_eq!(complaints, 0);
        assert_eq!(ini.sections["1000"].keys["a"].text, "1");
        assert_eq!(ini.sections["1001"].keys["b"].text, "2");
    }

    #[test]
    fn nonsense_is_told_and_left_out() {
        let (ini, complaints) = read("x=1\n[1000\nnonsense\n[a]\nk=1\nk=2\n[A]\nl=3\n# c\n");
        assert_eq!(complaints, 5);
        assert_eq!(ini.sections["a"].keys["k"].text, "2");
        assert_eq!(ini.sections["a"].keys["l"].text, "3");
    }
}
