//! What is wrong, where, by which rule, and what to do about it.

use std::fmt;
use std::ops::Range;

use crate::source::Source;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The network is refused.
    Error,
    /// It may work, but somebody should look.
    Warning,
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Problem {
    /// Whether it refuses the network.
    pub severity: Severity,
    /// The file.
    pub file: String,
    /// The line in it, counted from 1; 0 where it is the file as a whole.
    pub line: u32,
    /// The line as it stands there.
    pub text: String,
    /// The offending value.
    pub value: String,
    /// What it breaks.
    pub rule: String,
    /// What to do.
    pub suggestion: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        write!(f, "{severity}: {}", self.file)?;
        if self.line != 0 {
            write!(f, ":{}", self.line)?;
        }
        writeln!(f, ": `{}`: {}", self.value, self.rule)?;
        if !self.text.is_empty() {
            writeln!(f, "  | {}", self.text)?;
        }
        write!(f, "  = help: {}", self.suggestion)
    }
}

impl std::error::Error for Problem {}

/// Where something stands.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub(crate) source: Source,
    pub(crate) line: u32,
}

impl Place {
    pub(crate) fn at(source: &Source, span: &Range<usize>) -> Place {
        Place {
            source: source.clone(),
            line: source.line_of(span.start),
        }
    }

    pub(crate) fn line(source: &Source, line: u32) -> Place {
        Place {
            source: source.clone(),
            line,
        }
    }

    pub(crate) fn file(source: &Source) -> Place {
        Place::line(source, 0)
    }
}

/// Everything that was found so far.
#[derive(Debug, Default)]
pub(crate) struct Problems(Vec<Problem>);

impl Problems {
    pub(crate) fn error(
        &mut self,
        place: &Place,
        value: impl fmt::Display,
        rule: impl Into<String>,
        suggestion: impl Into<String>,
    ) {
        self.push(Severity::Error, place, value, rule, suggestion);
    }

    pub(crate) fn warning(
        &mut self,
        place: &Place,
        value: impl fmt::Display,
        rule: impl Into<String>,
        suggestion: impl Into<String>,
    ) {
        self.push(Severity::Warning, place, value, rule, suggestion);
    }

    fn push(
        &mut self,
        severity: Severity,
        place: &Place,
        value: impl fmt::Display,
        rule: impl Into<String>,
        suggestion: impl Into<String>,
    ) {
        let problem = Problem {
            severity,
            file: place.source.name().to_string(),
            line: place.line,
            text: match place.line {
                0 => String::new(),
                line => shortened(place.source.line(line)),
            },
            value: shortened(&value.to_string()),
            rule: rule.into(),
            suggestion: suggestion.into(),
        };
        // Nodes that share a device share what is wrong with it.
        if !self.0.contains(&problem) {
            self.0.push(problem);
        }
    }

    pub(crate) fn has_errors(&self) -> bool {
        self.0.iter().any(|p| p.severity == Severity::Error)
    }

    pub(crate) fn into_vec(self) -> Vec<Problem> {
        self.0
    }

    pub(crate) fn extend(&mut self, other: Vec<Problem>) {
        self.0.extend(other);
    }
}

/// The longest piece of a file that is shown.
const LONGEST: usize = 100;

fn shortened(text: &str) -> String {
    // Control characters of a broken file do not reach the terminal.
    let clean = text.chars().map(|c| if c.is_control() { '?' } else { c });
    let mut short: String = clean.clone().take(LONGEST).collect();
    if clean.count() > LONGEST {
        short.push_str("...");
    }
    short
}

/// The candidate most like `wrong`, if any is like it at all.
pub(crate) fn nearest<'a>(
    wrong: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let wrong = wrong.to_lowercase();
    candidates
        .into_iter()
        .map(|candidate| (distance(&wrong, &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| *distance <= candidate.chars().count().div_ceil(3))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein's distance: letters to insert, delete or replace.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let replace = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = replace.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested_and_no_far_one() {
        let names = ["Controlword", "Statusword", "Target velocity"];
        assert_eq!(nearest("contrlword", names), Some("Controlword"));
        assert_eq!(nearest("Target velocty", names), Some("Target velocity"));
        assert_eq!(nearest("Homing method", names), None);
        assert_eq!(distance("kitten", "sitting"), 3);
    }

    #[test]
    fn lines_are_counted_from_one() {
        let source = Source::new("f", b"a\r\nb\n\nc");
        assert_eq!(source.line_of(0), 1);
        assert_eq!(source.line_of(3), 2);
        assert_eq!(source.line_of(6), 4);
        assert_eq!(source.line(2), "b");
        assert_eq!(source.line(9), "");
    }

    #[test]
    fn what_is_not_utf8_is_latin1() {
        assert_eq!(Source::new("f", b"25 \xB0C").text(), "25 \u{B0}C");
        assert_eq!(Source::new("f", b"\xEF\xBB\xBF[x]").text(), "[x]");
    }
}
