use super::*;

#[test]
fn every_scenario_has_its_description() {
    for case in &CASES {
        assert!(case.path().is_file(), "{}", case.path().display());
    }
}
