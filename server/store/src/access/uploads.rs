//! Uploads, and ingest jobs of captures.

use crate::scripts::{signed_parts, upload_parts, uploads};
use crate::transaction::transaction;
use crate::{
    NewPart, NewUpload, PartId, RequestKey, Store, StoreError, StoredPart, Tenant, Upload,
};
use yoto_proto::v1::Capture;

impl Store {
    /// Opens an upload: a capture in state UPLOADING, with its files. Returns its id, or that of the
    /// upload that `request` opened before.
    pub async fn create_upload(
        &self,
        tenant: &Tenant,
        new: NewUpload,
        request: Option<RequestKey>,
    ) -> Result<String, StoreError> {
        transaction!(self, |tx| uploads::create(
            tx,
            tenant,
            new.clone(),
            request.clone()
        ))
    }

    /// Checks that the tenant has the upload, finished or not, without reading its files.
    pub async fn require_upload(&self, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
        uploads::require(&mut self.db.read().await?, tenant, id).await
    }

    /// An upload by id, finished or not.
    pub async fn upload(&self, tenant: &Tenant, id: &str) -> Result<Upload, StoreError> {
        let mut tx = self.db.snapshot().await?;
        uploads::get(&mut tx, tenant, id).await
    }

    /// Bytes of all open uploads that are still to come.
    pub async fn coming_bytes(&self) -> Result<u64, StoreError> {
        uploads::coming(&mut self.db.read().await?).await
    }

    /// Makes the caller the newest writer of an upload. Returns its number.
    pub async fn take_over_upload(&self, tenant: &Tenant, id: &str) -> Result<u64, StoreError> {
        transaction!(self, |tx| uploads::take_over(tx, tenant, id))
    }

    /// Records a part of an open upload that its newest writer has put into the object store, with all its pieces or none.
    pub async fn commit_part(
        &self,
        tenant: &Tenant,
        id: &str,
        part: &NewPart,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| upload_parts::commit(tx, tenant, id, part))
    }

    /// Checks that the upload is open and that `writer` is its newest writer.
    pub async fn require_writer(
        &self,
        tenant: &Tenant,
        id: &str,
        writer: u64,
    ) -> Result<(), StoreError> {
        uploads::require_writer(&mut self.db.read().await?, tenant, id, writer).await
    }

    /// Records a part of an open upload that its newest writer has put into the object store by itself, as
    /// [`Self::commit_part`]. Returns whether it is new; one that is recorded already is not changed.
    pub async fn commit_signed_part(
        &self,
        tenant: &Tenant,
        id: &str,
        part: &NewPart,
    ) -> Result<bool, StoreError> {
        transaction!(self, |tx| signed_parts::commit(tx, tenant, id, part))
    }

    /// Forgets the bytes of files of an open upload, for its newest writer.
    pub async fn restart_files(
        &self,
        tenant: &Tenant,
        id: &str,
        writer: u64,
        paths: &[String],
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| upload_parts::restart(
            tx, tenant, id, writer, paths
        ))
    }

    /// The parts of an upload, finished or not, in the order in which they have the bytes of each file.
    pub async fn upload_parts(
        &self,
        tenant: &Tenant,
        id: &str,
    ) -> Result<Vec<StoredPart>, StoreError> {
        let mut tx = self.db.snapshot().await?;
        uploads::require(&mut tx, tenant, id).await?;
        upload_parts::all(&mut tx, id).await
    }

    /// Those of the parts `ids` in the object store that belong to nothing.
    pub async fn orphans_of_upload(
        &self,
        id: &str,
        ids: &[PartId],
    ) -> Result<Vec<PartId>, StoreError> {
        upload_parts::orphans(&mut self.db.read().await?, id, ids).await
    }

    /// Ends a complete upload for its newest writer: the capture is INGESTING and its ingest job QUEUED, or neither. One that
    /// has ended is not changed.
    pub async fn finish_upload(
        &self,
        tenant: &Tenant,
        id: &str,
        writer: u64,
        request: Option<RequestKey>,
    ) -> Result<Capture, StoreError> {
        transaction!(self, |tx| uploads::finish(
            tx,
            tenant,
            id,
            writer,
            request.clone()
        ))
    }

    /// Queues another ingest job of a capture that is UPLOADED or REJECTED.
    pub async fn ingest_capture(
        &self,
        tenant: &Tenant,
        id: &str,
        request: Option<RequestKey>,
    ) -> Result<Capture, StoreError> {
        transaction!(self, |tx| uploads::ingest_again(
            tx,
            tenant,
            id,
            request.clone()
        ))
    }
}
