//! docs/operate/errors.md has a row for each reason, with its code.

use yoto_proto::reasons::code;
use yoto_proto::v1::ErrorReason;

const PAGE: &str = include_str!("../../docs/operate/errors.md");

#[test]
fn the_page_of_errors_has_each_reason_with_its_code() {
    let all = (1..200).filter_map(|number| ErrorReason::try_from(number).ok());
    let all: Vec<ErrorReason> = all.collect();
    assert!(all.len() >= 40, "{all:?}");
    for reason in all {
        let name = reason.as_str_name();
        let row = PAGE
            .lines()
            .find(|line| line.starts_with(&format!("| `{name}` |")));
        let row = row.unwrap_or_else(|| panic!("{name} is not on the page"));
        let spelled = format!("| {} |", spelled(code(reason)));
        assert!(row.contains(&spelled), "{row} has not {spelled}");
    }
}

/// INVALID_ARGUMENT for `InvalidArgument`.
fn spelled(code: tonic::Code) -> String {
    let mut text = String::new();
    for letter in format!("{code:?}").chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.push(letter.to_ascii_uppercase());
    }
    text
}
