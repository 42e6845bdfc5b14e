//! Words for deletions and sizes.

use yoto_proto::v1::Deleted;
use yoto_terminal::output;
use yoto_terminal::progress::count;

/// Prints that `what` was deleted, and what was deleted with it.
pub(crate) fn say_deleted(what: &str, deleted: &Deleted) {
    output::put("deleted", output::message(deleted));
    say!("{what} is deleted: {}", taken(deleted));
    tell!(
        "its files are removed after the service's time of grace; `yoto gc --now` removes them at once"
    );
}

/// `2 checkpoints, 1 job`.
fn taken(deleted: &Deleted) -> String {
    let all = [
        (deleted.captures, "capture"),
        (deleted.checkpoints, "checkpoint"),
        (deleted.jobs, "job"),
    ];
    let all = all.iter().filter(|(number, _)| *number > 0);
    let all: Vec<String> = all
        .map(|(number, what)| count(*number as usize, what))
        .collect();
    match all.is_empty() {
        true => "it had nothing".to_owned(),
        false => all.join(", "),
    }
}

/// The longest side of pictures, in words; 0 is the captures' own.
pub(crate) fn size_of(side: u32) -> String {
    match side {
        0 => "the captures' size".to_owned(),
        side => format!("{side} pixels"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_went_with_a_deletion_is_counted() {
        let deleted = Deleted {
            checkpoints: 2,
            jobs: 1,
            captures: 0,
        };
        assert_eq!(taken(&deleted), "2 checkpoints, 1 job");
        assert_eq!(taken(&Deleted::default()), "it had nothing");
    }
}
