//! Signed URLs stay out of logs.

use crate::v1::{SignDownloadResponse, SignedPart};
use std::fmt;

impl fmt::Debug for SignDownloadResponse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let url = if self.url.is_empty() { "" } else { "…" };
        f.debug_struct("SignDownloadResponse")
            .field("url", &url)
            .field("expire_time", &self.expire_time)
            .field("unsigned", &self.unsigned())
            .finish()
    }
}

impl fmt::Debug for SignedPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SignedPart").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::SignPartsResponse;

    #[test]
    fn a_url_is_not_shown() {
        let url = "https://store/key?X-Amz-Signature=0f";
        let download = SignDownloadResponse {
            url: url.into(),
            ..SignDownloadResponse::default()
        };
        let part = SignedPart {
            url: url.into(),
            ..SignedPart::default()
        };
        let parts = SignPartsResponse {
            parts: vec![part],
            ..SignPartsResponse::default()
        };
        for shown in [format!("{download:?}"), format!("{parts:?}")] {
            assert!(!shown.contains("store") && !shown.contains("0f"), "{shown}");
        }
    }
}
