-- the scans of each storey's last successful run, and what was read of them
select building, storey, name, format, points_read, points_kept, points_not_finite, points_cropped,
       snapshots, up, up_guessed, scale, scale_guessed, notes
from scans
order by building, storey, name
