//! Files that belong together: a detector writes one for each frame, named alike but for the numbers. Another take in the same folder
//! has another name, and often the same numbers.

use super::detections::numbers_in;
use crate::ImportError;
use crate::source::Source;
use std::collections::BTreeMap;

/// The name of a file with each of its numbers replaced.
fn pattern(name: &str) -> String {
    let mut pattern = String::new();
    for letter in name.trim_start_matches('/').chars() {
        match letter.is_ascii_digit() {
            true if pattern.ends_with('#') => {}
            true => pattern.push('#'),
            false => pattern.push(letter),
        }
    }
    pattern
}

/// Those of `files` that are of the series of the file `given`; all of them without one.
pub(super) fn of(files: Vec<String>, given: Option<&str>) -> Vec<String> {
    let wanted = given.map(pattern);
    let belongs = |file: &String| wanted.as_ref().is_none_or(|it| pattern(file) == *it);
    files.into_iter().filter(belongs).collect()
}

/// Makes sure that files of two series do not have frames of the same number, by the last number in their names. One without a number
/// is for itself.
///
/// # Errors
/// When two do: nobody knows which is meant.
pub(super) fn is_one(source: &Source, files: &[String]) -> Result<(), ImportError> {
    let mut of_number: BTreeMap<Option<usize>, &String> = BTreeMap::new();
    for file in files {
        let number = numbers_in(file).last().copied();
        let earlier = of_number.entry(number).or_insert(file);
        if pattern(earlier) != pattern(file) {
            let [one, other] = [earlier.as_str(), file].map(|it| it.trim_start_matches('/'));
            let message = format!(
                "two takes are in this folder, such as {one} and {other}: give one file of the take that is meant (--poses FILE)"
            );
            return Err(source.fault("UNSUITABLE", other, None, "", message));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files() -> Vec<String> {
        ["/A_001.json", "/A_002.json", "/B_001.json"]
            .map(String::from)
            .into()
    }

    #[test]
    fn a_series_is_told_by_what_is_not_a_number() {
        assert_eq!(of(files(), Some("A_002.json")), files()[..2]);
        assert_eq!(of(files(), None), files());
        assert_eq!(pattern("/clip2_0001.json"), pattern("clip13_9.json"));
    }

    #[test]
    fn two_takes_with_the_same_numbers_are_asked_about() {
        let source = Source::new(std::path::Path::new("points"));
        let error = is_one(&source, &files())
            .expect_err("B has the number 1 too")
            .to_string();
        assert!(
            error.contains("such as A_001.json and B_001.json"),
            "{error}"
        );
        is_one(&source, &files()[..2]).expect("one take");
        let apart = ["/A_001.json", "/B_002.json"].map(String::from);
        is_one(&source, &apart).expect("no number twice");
    }
}
