//! What a person has agreed to, with the files that prove it.

use super::{ExportedPart, PersonExport, id};
use std::ffi::OsStr;
use std::path::Path;
use yoto_terminal::output;

impl PersonExport<'_> {
    /// Writes the files that prove consents.
    pub(super) async fn consents(&self) -> anyhow::Result<ExportedPart> {
        let mut part = ExportedPart::default();
        for consent in self.client.list_consents(&self.subject.name).await? {
            part.about.push(output::message(&consent));
            let Some(evidence) = &consent.evidence else {
                continue;
            };
            let file = self.client.consent_evidence(&consent.name).await?;
            // Whatever the service says, the file stays in its folder.
            let name = Path::new(&evidence.file_name).file_name();
            let name = name.unwrap_or_else(|| OsStr::new("evidence"));
            let place = Path::new("consents").join(id(&consent.name)).join(name);
            part.files.push(self.write(&place, &file.content)?);
        }
        Ok(part)
    }
}
