//! Removals of people from everything that a service has.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient};
use yoto_proto::limits::LONGEST_PAGE_ENTRIES;
use yoto_proto::v1::{EraseSubjectRequest, Erasure, GetErasureRequest, ListErasuresRequest};

impl YotoClient {
    /// Begins to remove the person `subject`, who is called `display_name`. It goes on by itself. `retrain` also trains the others of
    /// models whose shared parameters were trained with them anew.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. when that is not their name.
    pub async fn erase_subject(
        &self,
        subject: &str,
        display_name: &str,
        retrain: bool,
    ) -> Result<Erasure, ClientError> {
        let request = EraseSubjectRequest {
            name: subject.to_owned(),
            display_name: display_name.to_owned(),
            retrain,
        };
        let erase = || {
            let (mut service, request) = (self.subject_service(), request.clone());
            async move { service.erase_subject(request).await }
        };
        let doing = format!("erasing {subject}");
        repeat(erase).await.map_err(ClientError::refused(doing))
    }

    /// The erasure `name`.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when there is no such erasure.
    pub async fn get_erasure(&self, name: &str) -> Result<Erasure, ClientError> {
        let get = || {
            let (mut service, name) = (self.subject_service(), name.to_owned());
            async move { service.get_erasure(GetErasureRequest { name }).await }
        };
        let found = read(get).await;
        found.map_err(ClientError::refused(format!("reading {name}")))
    }

    /// All erasures, newest first, over all pages.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_erasures(&self) -> Result<Vec<Erasure>, ClientError> {
        let (mut erasures, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListErasuresRequest {
                page_size: LONGEST_PAGE_ENTRIES as i32,
                page_token,
            };
            let list = || {
                let (mut service, request) = (self.subject_service(), request.clone());
                async move { service.list_erasures(request).await }
            };
            let page = read(list).await;
            let page = page.map_err(ClientError::refused("listing erasures"))?;
            erasures.extend(page.erasures);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(erasures);
            }
        }
    }
}
