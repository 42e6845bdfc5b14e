//! From a person's page to an avatar: a model with them, new or there already, and its training.

use super::actions::{SentForm, form, request_of};
use super::asker::Asker;
use super::orders::{minutes, order};
use super::page_error::PageError;
use super::query::Fields;
use super::words::{page_of, told};
use axum::extract::Path;
use axum::response::Response;
use maud::{Markup, html};
use tonic::Status;
use yoto_proto::tiers::DEFAULT_TIER;
use yoto_proto::v1::{AddIdentityRequest, CreateModelRequest, Model, Subject, TrainSpec, job_spec};
use yoto_store::Membership;

/// Minutes of a training unless the form says otherwise.
const MINUTES: u32 = 2;
/// Longest training that the form orders, minutes.
const LONGEST: u32 = 24 * 60;
/// The variant of new models.
const VARIANT: &str = "yoto";

/// The form on the page of `subject`; `others` are the models that they can join.
///
/// # Errors
/// When no layer has told who asks.
pub(crate) fn form_of(
    asker: &Asker,
    subject: &Subject,
    others: &[Membership],
) -> Result<Markup, Status> {
    let path = format!("{}/avatar", page_of(&subject.name));
    Ok(html! {
        details #avatar .act {
            summary { "Make an avatar…" }
            p { "A model learns the person from their capture; its page plays them then." }
            (form(asker, &path, &[], html! {
                label { "In "
                    select name="model" {
                        option value="" { "a model of their own" }
                        @for it in others { option value=(it.model) { (told(&it.display_name)) } }
                    }
                }
                label { "Minutes " input name="minutes" type="number" min="1" max=(LONGEST) value=(MINUTES) required; }
                button { "Train" }
            })?)
        }
    })
}

/// `POST /people/{id}/avatar`: a model for the person, a slot in it, and a training. In a model that was trained already, only what is
/// theirs is trained, and others stay as they are.
pub(crate) async fn make(
    asker: Asker,
    Path(id): Path<String>,
    SentForm(form): SentForm,
) -> Result<Response, PageError> {
    let minutes = minutes(&form, LONGEST)?;
    let subject = asker.subject(&format!("subjects/{id}")).await?;
    let model = model(&asker, &form, &subject).await?;
    let slot = AddIdentityRequest {
        model: model.name.clone(),
        subject: subject.name.clone(),
        request_id: request_of(&form),
    };
    asker
        .services()
        .models
        .add_identity(asker.request(slot))
        .await?;
    let spec = TrainSpec {
        only: match model.slots.iter().any(|it| it.trained) {
            true => subject.name,
            false => String::new(),
        },
        model: model.name,
        seconds: 60.0 * f64::from(minutes),
        ..TrainSpec::default()
    };
    order(&asker, &form, job_spec::Kind::Train(spec)).await
}

/// The model that the form names, or a new one that is called like the person.
async fn model(asker: &Asker, form: &Fields, subject: &Subject) -> Result<Model, Status> {
    let named = form.get("model");
    if !named.is_empty() {
        return asker.model(named).await;
    }
    let request = CreateModelRequest {
        display_name: subject.display_name.clone(),
        tier: DEFAULT_TIER.to_owned(),
        variant: VARIANT.to_owned(),
        request_id: request_of(form),
        ..CreateModelRequest::default()
    };
    let made = asker
        .services()
        .models
        .create_model(asker.request(request))
        .await;
    made.map(tonic::Response::into_inner)
}
