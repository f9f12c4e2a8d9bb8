-- the scans of each storey's last successful runs, and what was read of them
select building, storey, name, format, points_read, points_kept, points_not_finite, points_cropped,
       snapshots, up, up_guessed, scale, scale_guessed, notes
-- once, however many variants and seeds read it
from (select distinct * exclude (run, variant, seed, parameters) from scans)
order by building, storey, name
