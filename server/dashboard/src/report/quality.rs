//! Measured figures of a model, beside those of the paper.

use super::super::curves::figure;
use super::super::outcome;
use maud::{Markup, html};
use yoto_proto::published::{MEASURED_ON, TABLE};
use yoto_proto::v1::{EvaluateResult, Job, job_result};

/// Figures of the newest evaluation, and the published ones.
pub(super) fn section(evaluations: &[Job], variant: &str) -> Markup {
    let measured = evaluations.iter().find_map(scores);
    html! {
        @match measured {
            Some(it) => (outcome::evaluate(it)),
            None => p .empty { "It was not evaluated: " code { "yoto evaluate" } " measures held-out pictures of each person. The curves have held-out frames of the trainings." },
        }
        (published(measured, variant))
    }
}

/// The result of an evaluation that has figures; one that measured the trade-off alone has none.
fn scores(job: &Job) -> Option<&EvaluateResult> {
    match &job.result.as_ref()?.kind {
        Some(job_result::Kind::Evaluate(it)) if !it.subjects.is_empty() => Some(it),
        _ => None,
    }
}

/// The paper's table, with this model's means in the row of its variant.
fn published(measured: Option<&EvaluateResult>, variant: &str) -> Markup {
    let mean = measured.and_then(|it| it.mean);
    let thousandfold = |it: f64| 1000.0 * it;
    html! {
        details {
            summary { "Figures of the paper" }
            div .scroll tabindex="0" role="group" aria-label="Table" { table {
                thead { tr {
                    th { "Variant" } th { "PSNR, dB" } th { "SSIM" } th { "LPIPS × 1000" }
                    th { "This model, PSNR, dB" } th { "SSIM" } th { "LPIPS × 1000" }
                } }
                tbody { @for row in TABLE {
                    @let ours = mean.filter(|_| row.variant == variant);
                    tr {
                        th scope="row" { (row.variant) }
                        td { (figure(Some(row.psnr), 2)) }
                        td { (figure(Some(row.ssim), 4)) }
                        td { (figure(Some(thousandfold(row.lpips)), 2)) }
                        td { (figure(ours.map(|it| it.psnr), 2)) }
                        td { (figure(ours.map(|it| it.ssim), 4)) }
                        td { (figure(ours.and_then(|it| it.lpips).map(thousandfold), 2)) }
                    }
                } }
            } }
            p .detail {
                "Published: arXiv 2303.05835, Table 3, " (MEASURED_ON) ". Figures of other people, sizes and budgets can't be compared with it, and this \
                 model's are of its own people. The paper names neither SSIM's window nor its data range; here it is the Gaussian window of 11 pixels \
                 and a range of 1."
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::{JobResult, Scores, SubjectScores};

    fn evaluation(psnr: f64) -> Job {
        let result = EvaluateResult {
            subjects: vec![SubjectScores::default()],
            mean: Some(Scores {
                psnr,
                ..Scores::default()
            }),
            ..EvaluateResult::default()
        };
        Job {
            result: Some(JobResult {
                kind: Some(job_result::Kind::Evaluate(result)),
            }),
            ..Job::default()
        }
    }

    #[test]
    fn figures_stand_in_the_row_of_their_variant_alone() {
        let shown = section(&[evaluation(27.125)], "no-identity").into_string();
        let rows: Vec<&str> = shown.split("<tr>").collect();
        let with = |it: &&&str| it.contains("27.12") && it.contains("28.72");
        let row = rows.iter().filter(with).count();
        assert_eq!(row, 1, "{shown}");
        assert!(shown.contains("30.51"), "{shown}");
    }

    #[test]
    fn an_evaluation_without_scores_is_none() {
        let mut without = evaluation(30.0);
        if let Some(job_result::Kind::Evaluate(it)) =
            without.result.as_mut().and_then(|it| it.kind.as_mut())
        {
            it.subjects.clear();
        }
        let shown = section(&[without], "yoto").into_string();
        assert!(shown.contains("It was not evaluated"), "{shown}");
    }
}
