-- planes found in the scans against the true surfaces they show: precision, recall, degrees, metres
with counted as (
  select building, storey, variant, seed, bool_or(simulated) as simulated,
         -- a false find is of no true class: vertical ones stand for walls, as all that is upright
         case when class in ('wall', 'vertical') then 'vertical' else 'horizontal' end as kind,
         count(distinct scan) as scans,
         count(true_id) as n_true,
         count(found_segment) as n_found,
         count(iou) as n_matched,
         count(part_of) as n_again,
         median(degrees(angle_rad)) as angle_deg,
         median(abs(offset_m)) as offset_m,
         max(degrees(angle_rad)) as worst_angle_deg,
         max(abs(offset_m)) as worst_offset_m
  from plane_detections
  group by all
)
select building, storey, variant, kind,
       bool_or(simulated) as simulated,
       count(*) as seeds,
       round(avg(scans), 1) as scans,
       round(avg(n_matched / nullif(n_true, 0)), 4) as recall,
       round(confidence95(n_matched / nullif(n_true, 0)), 4) as recall_pm,
       round(avg(n_matched / nullif(n_found, 0)), 4) as precision,
       -- more than one segment on a surface: false finds, but no false surfaces
       round(avg((n_matched + n_again) / nullif(n_found, 0)), 4) as precision_of_surfaces,
       round(avg(angle_deg), 4) as median_angle_deg,
       round(max(worst_angle_deg), 3) as worst_angle_deg,
       round(avg(offset_m), 4) as median_offset_m,
       round(max(worst_offset_m), 3) as worst_offset_m
from counted
group by building, storey, variant, kind
order by building, storey, variant, kind
