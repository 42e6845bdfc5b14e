//! Scores of an evaluation by person.

use yoto_proto::v1::{EvaluateResult, Scores};

/// The scores of each person by name, then their mean.
pub(crate) fn score_rows(result: &EvaluateResult) -> Vec<(String, Scores)> {
    let people = result.subjects.iter().filter_map(|it| {
        let scores = it.scores?;
        Some((it.display_name.clone(), scores))
    });
    let mean = result.mean.map(|scores| ("mean".to_owned(), scores));
    people.chain(mean).collect()
}
