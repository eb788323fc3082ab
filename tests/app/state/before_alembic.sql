BEGIN TRANSACTION;
CREATE TABLE jobs (
            number INTEGER PRIMARY KEY AUTOINCREMENT,
            record TEXT NOT NULL,
            id TEXT UNIQUE GENERATED ALWAYS AS (record ->> 'id') VIRTUAL,
            owner TEXT GENERATED ALWAYS AS (record -> 'errand' ->> 'owner') VIRTUAL,
            idempotency_key TEXT
                GENERATED ALWAYS AS (record -> 'errand' ->> 'idempotency_key') VIRTUAL,
            status TEXT GENERATED ALWAYS AS (record ->> 'status') VIRTUAL,
            finished TEXT GENERATED ALWAYS AS (record ->> 'finished') VIRTUAL
        );
INSERT INTO "jobs" VALUES(1,'{"id":"06af5f88b3124639b59ecb49abaae717","errand":{"owner":"alice","kind":"distances","mesh_id":"00000000000000000000000000000000","media_type":"text/csv","dtype":"float64","coding":null,"client":"","fingerprint":"ab","idempotency_key":"a key","request_id":"r"},"status":"successful","progress":1.0,"version":3,"runs":1,"created":"2026-11-28T15:51:46.323470Z","started":"2026-11-28T15:51:46.331029Z","finished":"2026-11-28T15:51:46.331324Z","problem":null,"result":"m/a"}');
INSERT INTO "jobs" VALUES(2,'{"id":"e26c7c23df1e49b6931e4833635adf0b","errand":{"owner":null,"kind":"distances","mesh_id":"00000000000000000000000000000000","media_type":"text/csv","dtype":"float64","coding":null,"client":"","fingerprint":"ab","idempotency_key":null,"request_id":"r"},"status":"accepted","progress":0.0,"version":1,"runs":0,"created":"2026-11-28T15:51:46.323495Z","started":null,"finished":null,"problem":null,"result":null}');
INSERT INTO "jobs" VALUES(3,'{"id":"c3f4f746fcb248afa186323caacbacdf","errand":{"owner":"alice","kind":"distances","mesh_id":"00000000000000000000000000000000","media_type":"text/csv","dtype":"float64","coding":null,"client":"","fingerprint":"ab","idempotency_key":null,"request_id":"r"},"status":"running","progress":0.5,"version":2,"runs":1,"created":"2026-11-28T15:51:46.323504Z","started":"2026-11-28T15:51:46.331689Z","finished":null,"problem":null,"result":null}');
CREATE TABLE meshes (
            id TEXT PRIMARY KEY,
            size BIGINT NOT NULL,
            owner TEXT,
            used DOUBLE PRECISION NOT NULL,
            pinned DOUBLE PRECISION NOT NULL
        );
CREATE TABLE queries (job_id TEXT PRIMARY KEY, query BLOB NOT NULL);
INSERT INTO "queries" VALUES('e26c7c23df1e49b6931e4833635adf0b',X'7B22736F7572636573223A5B305D7D');
INSERT INTO "queries" VALUES('c3f4f746fcb248afa186323caacbacdf',X'7B22736F7572636573223A5B305D7D');
CREATE TABLE rates (caller TEXT PRIMARY KEY, due DOUBLE PRECISION NOT NULL);
CREATE TABLE work (
            id TEXT PRIMARY KEY,
            kind TEXT NOT NULL,
            caller TEXT NOT NULL,
            ends DOUBLE PRECISION NOT NULL
        );
CREATE INDEX jobs_of_owner ON jobs (COALESCE(owner, ''), number);
CREATE INDEX jobs_of_key ON jobs (COALESCE(owner, ''), idempotency_key)
            WHERE idempotency_key IS NOT NULL
        ;
CREATE INDEX jobs_by_end ON jobs (finished);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('jobs',3);
COMMIT;
