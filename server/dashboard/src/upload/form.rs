//! The form that adds a person. The script shows it, and owns it from then on (`data-own`): the page's own updates leave it alone.

use super::super::asker::Asker;
use super::super::assets::UPLOAD;
use super::super::token;
use maud::{Markup, html};
use serde_json::json;
use tonic::Status;
use yoto_proto::media_plan::{ARCHIVE_ENDINGS, CAPTURE_ARCHIVES, PICTURE_ENDINGS, VIDEO_ENDINGS};
use yoto_proto::pose_track;
use yoto_proto::v1::{GetLimitsRequest, Subject, UploadLimits};

/// What is said of a film without poses where no worker has a pose model.
const FILM: &str = "A film alone has no poses, and no worker of this service has a pose model to find them (`yoto serve --pose-model`). \
     `yoto avatar FILM` makes a person of it, and `yoto import` a capture of what a pose tool wrote.";

/// What the script has to know of a capture before it sends one: it has no such lists of its own. `limits` also say whether a worker
/// has a pose model.
fn rules(limits: &UploadLimits) -> String {
    let dotted = |endings: &[&str]| -> Vec<String> {
        let all = endings.iter().map(|it| format!(".{it}"));
        all.collect()
    };
    let (tracks, archives) = (pose_track::FILES.join(", "), ARCHIVE_ENDINGS.join(", "));
    json!({
        "tracks": pose_track::FILES,
        "archives": CAPTURE_ARCHIVES,
        "packed": ARCHIVE_ENDINGS,
        "videos": dotted(&VIDEO_ENDINGS),
        "pictures": dotted(&PICTURE_ENDINGS),
        "files": limits.files,
        "bytes": limits.capture_bytes,
        "films": limits.films,
        "film": FILM,
        "none": format!("None of {tracks} is among the files, nor one archive of all ({archives})."),
    })
    .to_string()
}

/// Whose capture a form adds.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Whose<'a> {
    /// Somebody's who is added with it; the form is open where there is nobody yet.
    New { open: bool },
    /// A further one of this person.
    Known(&'a Subject),
}

/// The form of a service with these limits.
///
/// # Errors
/// When no layer has told who asks.
pub(crate) fn form(
    asker: &Asker,
    whose: Whose<'_>,
    limits: &UploadLimits,
) -> Result<Markup, Status> {
    let rules = rules(limits);
    let (open, known) = match whose {
        Whose::New { open } => (open, None),
        Whose::Known(subject) => (false, Some(subject)),
    };
    let id = known.and_then(|it| it.name.split('/').next_back());
    Ok(html! {
        details #add open[open] {
            summary { @if known.is_some() { "Add a capture…" } @else { "Add a person…" } }
            noscript { p .message {
                "Without JavaScript this page can't send files. " code { "yoto subject add NAME CAPTURE" } " does."
            } }
            form .panel .upload data-own data-rules=(rules) data-person=[id] hidden {
                input type="hidden" name=(token::FIELD) value=(asker.token()?);
                @match known {
                    Some(subject) => {
                        input type="hidden" name="display_name" value=(subject.display_name);
                        label hidden { textarea name="consent_note" {} }
                        p .detail {
                            "It takes the place of the earlier capture in trainings from then on, once it is read and has no faults."
                        }
                    },
                    None => {
                        label { "Name" input name="display_name" required autocomplete="off"; }
                        label { "Consent, as it was given (optional)"
                            textarea name="consent_note" rows="2" {}
                        }
                    },
                }
                fieldset .drop {
                    legend { "Capture" }
                    @if limits.films {
                        p { "Drop a film, or a folder, its files, or an archive here, or choose:" }
                    } @else {
                        p { "Drop a folder, its files, or an archive here, or choose:" }
                    }
                    label { "a folder" input type="file" name="folder" webkitdirectory; }
                    label { "or files" input type="file" name="files" multiple; }
                    p .detail {
                        "A capture has " code { "poses.json" } ", pictures in " code { "frames/" } " or a " code { "video.mp4" }
                        ", and masks. "
                        @if limits.films {
                            "A film alone is enough: the service finds the person in it."
                        } @else {
                            "Of a film alone, " code { "yoto avatar" } " makes a person."
                        }
                    }
                }
                p #upload-chosen .detail {}
                p #upload-says role="status" {}
                ul #upload-faults .faults role="alert" {}
                div #upload-sent .progress hidden { progress aria-label="Upload" {} p .detail {} }
                div .buttons { button { "Upload" } button .bad type="button" hidden { "Give it up" } }
            }
            script type="module" src=(UPLOAD.path) {}
        }
    })
}

/// What an upload may have, and whether a worker finds poses in films.
///
/// # Errors
/// When the service can't tell.
pub(crate) async fn limits(asker: &Asker) -> Result<UploadLimits, Status> {
    let request = asker.request(GetLimitsRequest {});
    let limits = asker.services().status.get_limits(request).await?;
    Ok(limits.into_inner().upload.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn the_script_knows_the_rules_of_the_service() {
        let limits = UploadLimits {
            capture_bytes: 4711,
            films: true,
            ..UploadLimits::default()
        };
        let rules: Value = serde_json::from_str(&rules(&limits)).expect("JSON");
        assert_eq!(rules["films"], true);
        assert_eq!(rules["tracks"][0], "poses.json");
        assert_eq!(rules["videos"][0], ".mp4");
        assert_eq!(rules["packed"][0], ".zip");
        assert_eq!(rules["bytes"], limits.capture_bytes);
        let named = ["yoto avatar", "yoto import"].map(|it| FILM.contains(it));
        assert_eq!(named, [true, true]);
    }
}
