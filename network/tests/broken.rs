//! Broken descriptions and EDS files, each with the words that a user reads.

use std::path::Path;

use canmaster_network::{Severity, Source, read};

/// Two that are all right: what the others are made from.
const RIGHT: [&str; 3] = ["valid", "small", "cob_id_switched_off"];

#[test]
fn every_broken_input_has_its_message() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken");
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .filter_map(|file| {
            let name = file.unwrap().file_name().into_string().unwrap();
            name.strip_suffix(".toml").map(String::from)
        })
        .collect();
    names.sort();
    assert!(names.len() >= 40, "{}", names.len());
    for name in names {
        let file = format!("{name}.toml");
        let bytes = std::fs::read(folder.join(&file)).unwrap();
        let outcome = read(&Source::new(&file, &bytes), &mut |path| {
            std::fs::read(folder.join(path))
        });
        let problems = &outcome.problems;
        let refused = problems.iter().any(|p| p.severity == Severity::Error);
        assert_eq!(outcome.machine.is_none(), refused, "{name}");
        assert_eq!(
            problems.is_empty(),
            RIGHT.contains(&name.as_str()),
            "{name}: {problems:?}"
        );
        for problem in problems {
            assert!(
                !problem.file.is_empty() && !problem.value.is_empty(),
                "{name}"
            );
            assert!(
                !problem.rule.is_empty() && !problem.suggestion.is_empty(),
                "{name}"
            );
        }
        let words: Vec<String> = problems.iter().map(|p| p.to_string()).collect();
        insta::assert_snapshot!(name, words.join("\n\n"));
    }
}
