//! The calls of `yoto.v1.SubjectService` about erasures.

use super::{fields, paging};
use crate::context::Context;
use crate::erasure;
use yoto_proto::names::Collection;
use yoto_proto::v1::{
    EraseSubjectRequest, Erasure, GetErasureRequest, ListErasuresRequest, ListErasuresResponse,
};
use yoto_request::RequestError;
use yoto_store::Tenant;

/// `EraseSubject`.
pub(super) async fn begin(
    context: &Context,
    tenant: &Tenant,
    request: &EraseSubjectRequest,
) -> Result<Erasure, RequestError> {
    let id = fields::id(Collection::Subjects, "name", &request.name)?;
    // Once the person's row is gone, nothing has their name to compare.
    if context.store.erasure_of(tenant, &id).await?.is_none() {
        let subject = context.store.subject(tenant, &id).await?;
        if subject.display_name != request.display_name {
            let message = format!(
                "'{}' is not the name of {}: repeat it to erase them",
                request.display_name, subject.name
            );
            return Err(RequestError::invalid("display_name", message));
        }
    }
    let begun = context
        .store
        .begin_erasure(tenant, &id, request.retrain)
        .await?;
    tracing::info!(
        erasure = begun.name,
        subject = begun.subject,
        "a person is being erased"
    );
    erasure::tick(context).await;
    let id = fields::id(Collection::Erasures, "name", &begun.name)?;
    Ok(context.store.erasure(tenant, &id).await?)
}

/// `GetErasure`.
pub(super) async fn get(
    context: &Context,
    tenant: &Tenant,
    request: &GetErasureRequest,
) -> Result<Erasure, RequestError> {
    let id = fields::id(Collection::Erasures, "name", &request.name)?;
    Ok(context.store.erasure(tenant, &id).await?)
}

/// `ListErasures`.
pub(super) async fn list(
    context: &Context,
    tenant: &Tenant,
    request: &ListErasuresRequest,
) -> Result<ListErasuresResponse, RequestError> {
    let page = paging::Request::read("erasures", request.page_size, &request.page_token, &())?;
    let entries = context.store.erasures(tenant, page.page()).await?;
    let (erasures, next_page_token) = page.cut(entries);
    Ok(ListErasuresResponse {
        erasures,
        next_page_token,
    })
}
