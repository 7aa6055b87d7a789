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
        Source(Rc::new(Inner {
            name: name.into(),
            text,
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
        let before = self.text().bytes().take(offset);
        1 + before.filter(|byte| *byte == b'\n').count() as u32
    }

    /// What stands in a range, if it is one.
    pub fn slice(&self, range: Range<usize>) -> &str {
        self.text().get(range).unwrap_or_default()
    }

    /// A whole line without what surrounds it, counted from 1.
    pub fn line(&self, number: u32) -> &str {
        let skip = (number as usize).saturating_sub(1);
        self.text().lines().nth(skip).unwrap_or_default().trim()
    }
}
