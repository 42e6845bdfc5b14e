//! Names that people give checkpoints: `prod`.

/// Longest alias, bytes.
pub const LONGEST: usize = 32;
/// What an alias is, for people.
pub const RULE: &str =
    "an alias begins with a letter and has 1 to 32 of a-z, 0-9 and -; `best` is the service's own";

/// Whether `text` can be the alias of a checkpoint. A number is a step, and `best` the one with the best held-out PSNR.
pub fn is_alias(text: &str) -> bool {
    let known = |it: u8| it.is_ascii_lowercase() || it.is_ascii_digit() || it == b'-';
    text.len() <= LONGEST
        && text.starts_with(|it: char| it.is_ascii_lowercase())
        && text.bytes().all(known)
        && text != "best"
}

/// The model and the alias in `models/{id}/checkpoints/{alias}`.
pub fn of_checkpoint(name: &str) -> Option<(&str, &str)> {
    let (model, alias) = name.split_once("/checkpoints/")?;
    let id = model.strip_prefix("models/")?;
    is_alias(alias).then_some((id, alias))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alias_is_no_step() {
        for good in ["prod", "v2", "a-b"] {
            assert!(is_alias(good), "{good}");
        }
        for bad in [
            "",
            "2000",
            "Prod",
            "best",
            "-a",
            "a b",
            "a/b",
            &"a".repeat(33),
        ] {
            assert!(!is_alias(bad), "{bad}");
        }
        assert_eq!(
            of_checkpoint("models/m/checkpoints/prod"),
            Some(("m", "prod"))
        );
        assert_eq!(of_checkpoint("models/m/checkpoints/20"), None);
        assert_eq!(of_checkpoint("prod"), None);
    }
}
