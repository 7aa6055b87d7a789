//! A file that was read, and the lines in it.

use std::ops::Range;
use std::rc::Rc;

/// The text of a file and the name under which the user knows it.
#[derive(Clone, Debug)]
pub struct Source(Rc<Inner>);

#[derive(Debug)]
struct Inner {
    name: String,
    text: String,
    /// Where each line begins.
    starts: Vec<usize>,
}

impl Source {
    /// A file of this name with these bytes. What is not UTF-8 is taken as
    /// Latin-1, as editors of EDS files write it; lines may end in CR LF, LF or CR.
    pub fn new(name: impl Into<String>, bytes: &[u8]) -> Source {
        let text: String = match std::str::from_utf8(bytes) {
            Ok(text) => text.strip_prefix('\u{FEFF}').unwrap_or(text).to_string(),
            Err(_) => bytes.iter().copied().map(char::from).collect(),
        };
        // One kind of line end, so that everybody counts the same lines.
        let text = text.replace("\r\n", "\n").replace('\r', "\n");
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let starts = std::iter::once(0)
            .chain(ends.map(|(end, _)| end + 1))
            .collect();
        Source(Rc::new(Inner {
            name: name.into(),
            text,
            starts,
        }))
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// The line, counted from 1, in which `offset` lies.
    pub fn line_of(&self, offset: usize) -> u32 {
        self.0.starts.partition_point(|start| *start <= offset) as u32
    }

    /// What stands in a range, if it is one.
    pub fn slice(&self, range: Range<usize>) -> &str {
        self.text().get(range).unwrap_or_default()
    }

    /// A whole line without what surrounds it, counted from 1.
    pub fn line(&self, number: u32) -> &str {
        let place = (number as usize).saturating_sub(1);
        let start = self.0.starts.get(place).copied();
        let line = start.and_then(|start| self.text().get(start..)?.lines().next());
        line.unwrap_or_default().trim()
    }
}
