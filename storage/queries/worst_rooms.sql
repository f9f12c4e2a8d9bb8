-- the twenty rooms whose area was worst, of all plans ever compared; one not found errs by all of it
with compared as (
  -- a plan compared again with other thresholds is there twice
  select distinct building, storey, scan, variant, seed, simulated, true_id, true_class,
         true_m2, found_m2, value, abs(true_m2 - coalesce(found_m2, 0)) as error_m2
  from detections_all
  where class = 'room' and metric = 'iou' and threshold = 0 and true_id is not null
)
select building, storey, scan, variant, seed, simulated, true_id as room, true_class as class,
       round(true_m2, 3) as true_m2,
       round(found_m2, 3) as found_m2,
       round(error_m2, 3) as error_m2,
       round(value, 4) as iou
from compared
order by compared.error_m2 desc, building, storey, scan, variant, seed, room
limit 20
